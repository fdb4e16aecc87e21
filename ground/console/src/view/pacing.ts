/**
 * When the next picture is painted: only if somebody asked for one, and not before the last is old enough.
 */

import type { Painter } from './painter';

/** So many pictures in a row say how dear one is. */
const SAMPLE = 12;

export class Pacing {
  private asked = false;
  private last = -Infinity;
  private spent = 0;
  /** Negative at first: shaders are made during the first pictures, which says nothing of the others. */
  private counted = -SAMPLE;

  constructor(
    private readonly painter: Painter,
    private readonly draw: () => void,
  ) {}

  /** Asks for a picture. Any number of requests before it is painted are one. */
  ask(): void {
    if (this.asked) return;
    this.asked = true;
    const early = this.last + this.painter.intervalMs - performance.now();
    // A frame may come a little early: waiting for the next would halve the rate.
    if (early > 8) window.setTimeout(() => requestAnimationFrame(() => this.paint()), early - 8);
    else requestAnimationFrame(() => this.paint());
  }

  private paint(): void {
    this.asked = false;
    const start = performance.now();
    this.last = start;
    this.draw();
    // The time until the browser is ready for another frame includes what a processor that plays GPU takes.
    requestAnimationFrame(() => this.count(performance.now() - start));
  }

  private count(ms: number): void {
    this.counted += 1;
    if (this.counted <= 0) return;
    this.spent += Math.min(ms, 500);
    if (this.counted < SAMPLE) return;
    this.painter.took(this.spent / this.counted);
    this.spent = 0;
    this.counted = 0;
  }
}
