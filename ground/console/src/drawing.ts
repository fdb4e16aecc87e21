/**
 * Drawing a zone: a mode in which clicks on the ground set its corners, and fields say what it is and how high.
 */

import { html, setText } from './dom';
import { ZoneKind } from './vocabulary';
import { spaced } from './words';
import type { ZoneTable } from './zone';

/** A place on the ground, metres east and north. */
export type Place = [x: number, y: number];

export class Drawing {
  private readonly hint = html('span', { class: 'placing-hint', role: 'status' });
  private readonly kind = html('select', { 'aria-label': 'What it is' });
  private readonly name = html('input', { type: 'text', maxlength: '32', spellcheck: 'false', 'aria-label': 'Name of the zone' });
  private readonly radius = metres('Radius of the circle, in metres', 'none');
  private readonly low = metres('Its lower end, in metres', 'ground');
  private readonly high = metres('Its upper end, in metres', 'sky');
  private readonly minutes = metres('How many minutes from now it counts; empty: until it is removed', 'ever');
  private readonly send = html('button', { type: 'button', class: 'command command-draw' }, 'Draw');
  private readonly bar: HTMLElement;
  private places: Place[] = [];
  private on = false;

  constructor(
    stage: HTMLElement,
    private readonly events: {
      changed(on: boolean, places: readonly Place[], radius: number | null): void;
      drawn(zone: ZoneTable): void;
    },
  ) {
    for (const kind of Object.values(ZoneKind)) this.kind.append(html('option', { value: kind }, spaced(kind)));
    const link = (word: string) => html('button', { type: 'button', class: 'link-button' }, word);
    const [undo, cancel] = [link('Undo'), link('Cancel')];
    undo.addEventListener('click', () => this.change(this.places.slice(0, -1)));
    cancel.addEventListener('click', () => this.set(false));
    this.send.addEventListener('click', () => this.finish());
    for (const field of [this.kind, this.name, this.radius, this.low, this.high]) field.addEventListener('input', () => this.show());
    this.bar = html(
      'div',
      { class: 'placing-bar drawing-bar', hidden: true },
      html('label', {}, 'Zone', this.name),
      this.kind,
      label('Radius', this.radius),
      label('From', this.low),
      label('to', this.high),
      label('for', this.minutes, 'min'),
      this.hint,
      undo,
      this.send,
      cancel,
    );
    stage.append(this.bar);
  }

  get active(): boolean {
    return this.on;
  }

  /** `taken` are the names of the zones that are drawn. */
  set(on: boolean, taken: readonly string[] = []): void {
    if (on === this.on) return;
    this.on = on;
    this.bar.hidden = !on;
    if (on) this.name.value = freeName(taken);
    this.change([]);
  }

  add(place: Place): void {
    // A rally point is one place.
    this.change(this.kind.value === ZoneKind.rally ? [place] : [...this.places, place]);
  }

  private change(places: Place[]): void {
    this.places = places;
    this.show();
  }

  private show(): void {
    const drawn = this.table();
    this.send.disabled = typeof drawn === 'string';
    setText(this.hint, typeof drawn === 'string' ? drawn : 'Ready to draw');
    this.events.changed(this.on, this.places, this.places.length === 1 ? number(this.radius) : null);
  }

  private finish(): void {
    const drawn = this.table();
    if (typeof drawn === 'string') return;
    const minutes = number(this.minutes);
    this.set(false);
    this.events.drawn(minutes === null ? drawn : { ...drawn, until_s: Date.now() / 1000 + minutes * 60 });
  }

  private table(): ZoneTable | string {
    const values = { radius: number(this.radius), low: number(this.low), high: number(this.high) };
    return zoneTable(this.name.value.trim(), this.kind.value as ZoneKind, this.places, values);
  }
}

/** The zone that was drawn, or what is still to be done. */
export function zoneTable(
  name: string,
  kind: ZoneKind,
  places: readonly Place[],
  { radius, low, high }: { radius: number | null; low: number | null; high: number | null },
): ZoneTable | string {
  if (!name) return 'Give it a name';
  const isLimit = kind === ZoneKind.notAbove || kind === ZoneKind.notBelow;
  const height = kind === ZoneKind.notAbove || kind === ZoneKind.rally ? high : low;
  if ((isLimit || kind === ZoneKind.rally) && height === null) return `Say the height${kind === ZoneKind.notBelow ? ' from' : ' to'} which it reaches`;
  const [first] = places;
  const heights = isLimit || kind === ZoneKind.rally ? { height_m: height! } : kind === ZoneKind.threat ? {} : { ...(low !== null && { floor_m: low }), ...(high !== null && { ceiling_m: high }) };
  if (kind === ZoneKind.rally) return first ? { name, kind, centre_m: first, ...heights } : 'Click its place';
  if (isLimit && !first) return { name, kind, ...heights };
  if (!first) return 'Click its corners on the ground, or its middle';
  if (places.length === 1) return radius !== null ? { name, kind, centre_m: first, radius_m: radius, ...heights } : 'Give a radius, or click more corners';
  if (kind === ZoneKind.threat) return 'A threat is a circle: undo, and give a radius';
  return places.length === 2 ? 'Click a third corner' : { name, kind, corners_m: [...places], ...heights };
}

function freeName(taken: readonly string[]): string {
  for (let number = 1; ; number += 1) if (!taken.includes(`zone-${number}`)) return `zone-${number}`;
}

function metres(name: string, placeholder: string): HTMLInputElement {
  return html('input', { type: 'number', inputmode: 'decimal', step: 'any', placeholder, 'aria-label': name });
}

function label(word: string, field: HTMLElement, unit = 'm'): HTMLElement {
  return html('label', {}, word, field, unit);
}

function number({ value, validity }: HTMLInputElement): number | null {
  return validity.badInput || value.trim() === '' || !Number.isFinite(Number(value)) ? null : Number(value);
}
