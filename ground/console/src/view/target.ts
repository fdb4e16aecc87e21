/**
 * Where a go-to leads: a cross in a circle on the ground, and a pole up to its height if it has one.
 */

import type { Object3D } from 'three';
import type { Point, Vec3 } from '../protocol';
import type { Eye } from './eye';
import type { Painter } from './painter';
import type { Palette } from './palette';
import { circle, makeStrokes } from './strokes';

const RADIUS_PX = 12;

export class Target {
  private readonly strokes;

  constructor(kind: Painter['kind']) {
    this.strokes = makeStrokes(kind, { width: 2.5, order: 3, flat: true });
  }

  get object(): Object3D {
    return this.strokes.object;
  }

  show(point: Point | null, eye: Eye, groundZ: number, palette: Palette): void {
    this.strokes.clear();
    const foot: Vec3 | null = point && [point[0], point[1], groundZ];
    const seen = foot && eye.project(foot);
    if (point && foot && seen) {
      const radius = eye.metresPerPixel(seen.distance) * RADIUS_PX;
      const [x, y] = foot;
      circle(this.strokes, foot, radius, palette.target);
      this.strokes.line([x - radius * 1.5, y, groundZ], [x + radius * 1.5, y, groundZ], palette.target);
      this.strokes.line([x, y - radius * 1.5, groundZ], [x, y + radius * 1.5, groundZ], palette.target);
      if (point[2] !== null && point[2] > groundZ) {
        this.strokes.line(foot, [x, y, point[2]], palette.target);
        circle(this.strokes, [x, y, point[2]], radius * 0.5, palette.target, 14);
      }
    }
    this.strokes.done();
  }
}
