/**
 * A route that is being drawn, and the ways that selected vehicles still have to fly: a line through the points, with a
 * pole from each down to the ground.
 */

import type { Color, Object3D } from 'three';
import type { Vec3 } from '../protocol';
import type { Painter } from './painter';
import type { Palette } from './palette';
import { dashes, makeStrokes, polyline } from './strokes';

/** Half the width of the cross at a point, metres. */
const CROSS_M = 0.6;
const DASH_M = 1.5;

export class RouteLine {
  private readonly strokes;

  constructor(kind: Painter['kind']) {
    this.strokes = makeStrokes(kind, { width: 2.5, order: 3 });
  }

  get object(): Object3D {
    return this.strokes.object;
  }

  /** `drawn` leads on from `from`, if that is known; `told` are ways of vehicles, each from where it is. */
  show(drawn: readonly Vec3[], from: Vec3 | null, told: readonly (readonly Vec3[])[], groundZ: number, palette: Palette): void {
    this.strokes.clear();
    for (const way of told) {
      dashes(this.strokes, way, palette.target, DASH_M);
      way.slice(1).forEach((point) => this.pole(point, groundZ, palette.target));
    }
    polyline(this.strokes, from ? [from, ...drawn] : drawn, palette.target);
    drawn.forEach((point) => this.pole(point, groundZ, palette.target));
    this.strokes.done();
  }

  private pole([x, y, z]: Vec3, groundZ: number, colour: Color): void {
    this.strokes.line([x, y, groundZ], [x, y, z], colour);
    this.strokes.line([x - CROSS_M, y, z], [x + CROSS_M, y, z], colour);
    this.strokes.line([x, y - CROSS_M, z], [x, y + CROSS_M, z], colour);
  }
}
