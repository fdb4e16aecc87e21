/**
 * Placing a go-to: a mode in which a click on the ground says where, and a field how high.
 */

import { html } from './dom';

export class Placing {
  private readonly height = html('input', {
    type: 'number',
    inputmode: 'decimal',
    step: '0.5',
    min: '0',
    placeholder: 'keep',
    'aria-label': 'Height in metres above ground; empty keeps the height of each vehicle',
  });
  private readonly bar: HTMLElement;
  private on = false;

  constructor(
    stage: HTMLElement,
    private readonly changed: (on: boolean) => void,
  ) {
    const leave = html('button', { type: 'button', class: 'link-button' }, 'Cancel');
    leave.addEventListener('click', () => this.set(false));
    this.bar = html(
      'div',
      { class: 'placing-bar', role: 'status', hidden: true },
      html('span', { class: 'placing-hint' }, 'Click the place on the ground'),
      html('label', {}, 'Height', this.height, 'm'),
      leave,
      html('kbd', { 'aria-hidden': 'true' }, 'Esc'),
    );
    stage.append(this.bar);
  }

  get active(): boolean {
    return this.on;
  }

  set(on: boolean): void {
    if (on === this.on) return;
    this.on = on;
    this.bar.hidden = !on;
    this.changed(on);
  }

  toggle(): void {
    this.set(!this.on);
  }

  /** Metres above ground; `null` if each vehicle keeps its height; `undefined` if what was typed is no height. */
  get metres(): number | null | undefined {
    if (this.height.validity.badInput) return undefined;
    if (this.height.value.trim() === '') return null;
    const metres = Number(this.height.value);
    return Number.isFinite(metres) && metres >= 0 ? metres : undefined;
  }
}
