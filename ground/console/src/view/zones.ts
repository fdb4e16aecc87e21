/**
 * Zones: their outlines at both ends, joined by posts; of the one that is being drawn, what is there of it.
 */

import type { Color, Object3D } from 'three';
import type { Place } from '../drawing';
import type { Vec3, Zone } from '../protocol';
import { ZoneKind } from '../vocabulary';
import type { ZoneTable } from '../zone';
import type { Painter } from './painter';
import type { Palette } from './palette';
import { makeStrokes, polyline } from './strokes';

const SIDES = 40;
/** Rings of a hemisphere. */
const RINGS = 4;
/** From post to post around a circle. */
const POST_EVERY = 5;
/** Half the width of the cross of a rally point, and of a corner that is being drawn, metres. */
const CROSS_M = 0.8;

export class Zones {
  private readonly strokes;

  constructor(kind: Painter['kind']) {
    this.strokes = makeStrokes(kind, { width: 2.5, order: 2 });
  }

  get object(): Object3D {
    return this.strokes.object;
  }

  /** `low` and `high` stand in for the ends of zones that have none. */
  show(zones: readonly Zone[], drawn: readonly Place[], radius: number | null, [low, high]: [number, number], palette: Palette): void {
    this.strokes.clear();
    for (const { zone, going } of zones) this.zone(zone, [low, high], going ? palette.lost : colourOf(zone.kind, palette));
    for (const place of drawn) this.cross([...place, low], palette.target);
    if (radius !== null && drawn[0]) this.upright(ring(drawn[0], radius), low, high, POST_EVERY, palette.target);
    else if (drawn.length > 2) this.upright([...drawn], low, high, 1, palette.target);
    else polyline(this.strokes, drawn.map((place): Vec3 => [...place, low]), palette.target);
    this.strokes.done();
  }

  private zone(zone: ZoneTable, [low, high]: [number, number], colour: Color): void {
    const [from, to] = endsOf(zone, low, high);
    if (zone.kind === ZoneKind.rally && zone.centre_m) {
      this.cross([...zone.centre_m, to], colour);
      this.strokes.line([...zone.centre_m, low], [...zone.centre_m, to], colour);
    } else if (zone.kind === ZoneKind.threat && zone.centre_m) {
      this.hemisphere(zone.centre_m, zone.radius_m ?? 0, low, colour);
    } else if (zone.corners_m) {
      this.upright(zone.corners_m, from, to, 1, colour);
    } else if (zone.centre_m) {
      this.upright(ring(zone.centre_m, zone.radius_m ?? 0), from, to, POST_EVERY, colour);
    }
  }

  private upright(corners: readonly Place[], low: number, high: number, postEvery: number, colour: Color): void {
    for (const z of low === high ? [low] : [low, high]) {
      const around = corners.map(([x, y]): Vec3 => [x, y, z]);
      polyline(this.strokes, [...around, around[0]!], colour);
    }
    corners.forEach(([x, y], index) => index % postEvery === 0 && this.strokes.line([x, y, low], [x, y, high], colour));
  }

  private hemisphere(centre: Place, radius: number, low: number, colour: Color): void {
    for (let k = 0; k < RINGS; k += 1) {
      const angle = (Math.PI / 2) * (k / RINGS);
      const around = ring(centre, radius * Math.cos(angle)).map(([x, y]): Vec3 => [x, y, low + radius * Math.sin(angle)]);
      polyline(this.strokes, [...around, around[0]!], colour);
    }
  }

  private cross([x, y, z]: Vec3, colour: Color): void {
    this.strokes.line([x - CROSS_M, y, z], [x + CROSS_M, y, z], colour);
    this.strokes.line([x, y - CROSS_M, z], [x, y + CROSS_M, z], colour);
  }
}

/** The heights between which a zone stands, as far as they can be shown. */
export function endsOf({ kind, floor_m, ceiling_m, height_m }: ZoneTable, low: number, high: number): [number, number] {
  const height = height_m ?? low;
  switch (kind) {
    case ZoneKind.notAbove:
      return [height, Math.max(height, high)];
    case ZoneKind.notBelow:
      return [low, height];
    case ZoneKind.rally:
      return [height, height];
    default:
      return [Math.max(floor_m ?? low, low), ceiling_m ?? high];
  }
}

function ring([x, y]: Place, radius: number): Place[] {
  return Array.from({ length: SIDES }, (_, i): Place => {
    const angle = (2 * Math.PI * i) / SIDES;
    return [x + radius * Math.cos(angle), y + radius * Math.sin(angle)];
  });
}

function colourOf(kind: ZoneKind, palette: Palette): Color {
  const keepsIn = kind === ZoneKind.stayInside || kind === ZoneKind.rally;
  return keepsIn ? palette.zoneIn : palette.zoneOut;
}
