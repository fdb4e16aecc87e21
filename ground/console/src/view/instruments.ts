/**
 * Compass and scale, in the corners of the view.
 */

import { html, setText, svg } from '../dom';
import type { Eye } from './eye';

const LONGEST_PX = 110;
const STEPS = [1, 2, 5];

/** The longest round number of metres that is no longer than `most`. */
export function roundLength(most: number): number {
  const power = 10 ** Math.floor(Math.log10(most));
  return Math.max(...STEPS.map((step) => step * power).filter((length) => length <= most));
}

export class Instruments {
  readonly element: HTMLElement;
  private readonly rose: SVGGElement;
  private readonly bar = html('span', { class: 'scale-bar' });
  private readonly length = html('span', { class: 'scale-length' });
  private readonly grid = html('span', { class: 'scale-grid' });
  private readonly letters: { text: SVGTextElement; angle: number }[] = [];

  constructor() {
    this.rose = svg(
      'g',
      {},
      svg('circle', { r: '21', class: 'rose-rim' }),
      svg('path', { d: 'M0-19L5 0H-5z', class: 'rose-north' }),
      svg('path', { d: 'M0 19L5 0H-5z', class: 'rose-south' }),
    );
    const compass = svg(
      'svg',
      { class: 'compass', viewBox: '-30 -30 60 60', role: 'img', 'aria-label': 'Compass' },
      this.rose,
    );
    this.element = html(
      'div',
      { class: 'instruments' },
      compass,
      html('div', { class: 'scale', title: 'Length at the middle of the view' }, html('span', { class: 'scale-words' }, this.length, this.grid), this.bar),
    );
    for (const [letter, angle] of [['N', 0], ['E', 90], ['S', 180], ['W', 270]] as const) {
      const text = svg('text', { class: letter === 'N' ? 'rose-letter rose-n' : 'rose-letter' }, letter);
      this.letters.push({ text, angle: (angle * Math.PI) / 180 });
      compass.append(text);
    }
  }

  update(eye: Eye, gridM: number): void {
    const flat = Math.max(0.35, eye.steepness);
    const degrees = (eye.north * 180) / Math.PI;
    this.rose.setAttribute('transform', `scale(1 ${flat.toFixed(3)}) rotate(${degrees.toFixed(1)})`);
    for (const { text, angle } of this.letters) {
      const [x, y] = [26 * Math.sin(angle + eye.north), -26 * Math.cos(angle + eye.north) * flat];
      text.setAttribute('x', x.toFixed(1));
      text.setAttribute('y', (y + 3).toFixed(1));
    }
    const perPixel = eye.metresPerPixel(eye.distance);
    const length = roundLength(LONGEST_PX * perPixel);
    this.bar.style.width = `${Math.round(length / perPixel)}px`;
    setText(this.length, `${length < 1 ? length.toFixed(1) : length} m`);
    setText(this.grid, `grid ${gridM} m`);
  }
}
