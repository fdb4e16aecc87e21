/**
 * The obstacles, merged into one shape.
 */

import {
  BoxGeometry,
  type BufferGeometry,
  CylinderGeometry,
  EdgesGeometry,
  Group,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  Quaternion,
  SphereGeometry,
  Vector3,
} from 'three';
import type { Obstacle, Vec3 } from '../protocol';
import type { Painter } from './painter';
import type { Palette } from './palette';
import { shaded } from './shading';
import { makeStrokes } from './strokes';

export function makeObstacles(kind: Painter['kind'], obstacles: readonly Obstacle[], palette: Palette): Group {
  const group = new Group();
  if (obstacles.length === 0) return group;
  const fine = kind === 'webgl';
  const shapes = obstacles.map((obstacle) => shapeOf(obstacle, fine));
  const mesh = new Mesh(shaded(shapes, palette.obstacleLit, palette.obstacleShade, !fine), new MeshBasicMaterial({ vertexColors: true }));
  group.add(mesh);

  // Thousands of edges would be too much for SVG.
  if (fine) {
    const edges = makeStrokes(kind, { width: 1, order: 1 });
    for (const shape of shapes) {
      const ends = new EdgesGeometry(shape, 40).getAttribute('position');
      const end = (i: number): Vec3 => [ends.getX(i), ends.getY(i), ends.getZ(i)];
      for (let i = 0; i < ends.count; i += 2) edges.line(end(i), end(i + 1), palette.obstacleEdge);
    }
    edges.done();
    group.add(edges.object);
  }
  return group;
}

function shapeOf(obstacle: Obstacle, fine: boolean): BufferGeometry {
  const place = new Matrix4().compose(
    new Vector3(...obstacle.position),
    new Quaternion(...obstacle.orientation).normalize(),
    new Vector3(1, 1, 1),
  );
  return form(obstacle, fine).applyMatrix4(place);
}

function form(obstacle: Obstacle, fine: boolean): BufferGeometry {
  switch (obstacle.form) {
    case 'box':
      return new BoxGeometry(...obstacle.size);
    case 'cylinder':
      // Three.js' cylinders stand along y.
      return new CylinderGeometry(obstacle.radius, obstacle.radius, obstacle.height, fine ? 18 : 7).rotateX(Math.PI / 2);
    case 'sphere':
      return new SphereGeometry(obstacle.radius, fine ? 24 : 8, fine ? 16 : 6);
  }
}
