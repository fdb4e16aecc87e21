/**
 * Where each vehicle was during the last minute.
 */

import type { Vec3 } from '../protocol';

export const TRAIL_S = 60;
/** A point is kept when the vehicle has moved this far from the last one. */
const STEP_M = 0.3;

export interface TrailPoint {
  time: number;
  at: Vec3;
}

export class Trails {
  private readonly trails = new Map<string, TrailPoint[]>();
  private now = 0;

  /** Time that runs backwards means a new run: what was flown before it is forgotten. */
  advance(now: number): void {
    if (now < this.now - 1) this.trails.clear();
    this.now = now;
    for (const trail of this.trails.values()) {
      while (trail.length > 0 && trail[0]!.time < now - TRAIL_S) trail.shift();
    }
  }

  add(name: string, at: Vec3): void {
    const trail = this.trails.get(name) ?? [];
    this.trails.set(name, trail);
    const last = trail.at(-1);
    if (last && Math.hypot(at[0] - last.at[0], at[1] - last.at[1], at[2] - last.at[2]) < STEP_M) return;
    trail.push({ time: this.now, at });
  }

  of(name: string): readonly TrailPoint[] {
    return this.trails.get(name) ?? [];
  }

  /** 1 for a point of now, 0 for one about to be forgotten. */
  freshness(point: TrailPoint): number {
    return Math.min(1, Math.max(0, 1 - (this.now - point.time) / TRAIL_S));
  }
}
