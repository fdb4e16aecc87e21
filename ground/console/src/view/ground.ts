/**
 * The ground: a plate with a metre grid, the bounds standing on it.
 */

import { Group, Mesh, MeshBasicMaterial, PlaneGeometry } from 'three';
import type { Bounds, Vec3 } from '../protocol';
import type { Painter } from './painter';
import type { Palette } from './palette';
import { makeStrokes, polyline } from './strokes';

/** What is on the ground is painted in this order, and all before what stands on it. */
export const GROUND_ORDER = { plate: -9, grid: -8, bounds: -7, shadows: -6, rings: -5 } as const;

const STEPS_M = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const MOST_LINES = 80;

/** How far apart grid lines are, so that they remain countable. */
export function gridStep(extent: number): number {
  return STEPS_M.find((step) => extent / step <= MOST_LINES) ?? 1000;
}

/** `area` is what the plate must hold; `bounds` are outlined if there are any. */
export function makeGround(kind: Painter['kind'], area: Bounds, bounds: Bounds | null, palette: Palette): Group {
  const group = new Group();
  const z = area.min[2];
  const step = gridStep(Math.max(area.max[0] - area.min[0], area.max[1] - area.min[1]));
  const margin = step * (step === 1 ? 2 : 1);
  const [west, south] = [area.min[0], area.min[1]].map((edge) => Math.floor((edge - margin) / step) * step) as [number, number];
  const [east, north] = [area.max[0], area.max[1]].map((edge) => Math.ceil((edge + margin) / step) * step) as [number, number];

  const plate = new Mesh(
    new PlaneGeometry(east - west, north - south),
    new MeshBasicMaterial({ color: palette.ground, depthWrite: false }),
  );
  plate.position.set((west + east) / 2, (south + north) / 2, z);
  plate.renderOrder = GROUND_ORDER.plate;
  group.add(plate);

  const fine = makeStrokes(kind, { width: 1, order: GROUND_ORDER.grid, flat: true });
  const lines = (from: number, to: number, draw: (at: number, strong: boolean) => void) => {
    for (let n = Math.round(from / step); n <= Math.round(to / step); n += 1) draw(n * step, n % 5 === 0);
  };
  for (const strongNow of [false, true]) {
    const colour = strongNow ? palette.gridStrong : palette.grid;
    lines(west, east, (x, strong) => strong === strongNow && fine.line([x, south, z], [x, north, z], colour));
    lines(south, north, (y, strong) => strong === strongNow && fine.line([west, y, z], [east, y, z], colour));
  }
  fine.done();
  group.add(fine.object);

  if (bounds) group.add(...outline(kind, bounds, z, palette));
  return group;
}

/** A line around the ground, and a post as high as the ceiling on each corner. */
function outline(kind: Painter['kind'], { min, max }: Bounds, z: number, palette: Palette) {
  const corners: Vec3[] = [
    [min[0], min[1], z],
    [max[0], min[1], z],
    [max[0], max[1], z],
    [min[0], max[1], z],
  ];
  const floor = makeStrokes(kind, { width: 2, order: GROUND_ORDER.bounds, flat: true });
  polyline(floor, [...corners, corners[0]!], palette.bounds);
  floor.done();

  const posts = makeStrokes(kind, { width: 1, order: 0 });
  for (const corner of corners) posts.line(corner, [corner[0], corner[1], max[2]], palette.bounds);
  posts.done();
  return [floor.object, posts.object];
}
