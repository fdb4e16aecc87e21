/**
 * Names over the vehicles. They are ordinary page elements, so they stay sharp and look the same under either painter;
 * one that would cover another or a vehicle moves aside.
 */

import { badge } from '../badge';
import { html, setText } from '../dom';
import type { Identity } from '../identity';
import type { Point, Vehicle } from '../protocol';
import { durationWords } from '../words';
import type { Eye } from './eye';
import { glyphRadius } from './glyph';

/** In a larger fleet only badges are shown, and the names of the selected. */
const MOST_NAMES = 12;

interface Box {
  left: number;
  top: number;
  width: number;
  height: number;
}

interface Label {
  element: HTMLElement;
  text: HTMLElement;
  badge: SVGSVGElement;
  look: Identity;
  size: { width: number; height: number } | null;
  shown: string;
  box: Box | null;
  /** Which of the places around its vehicle it has. */
  side: number;
}

export class Labels {
  readonly element = html('div', { class: 'labels', 'aria-hidden': 'true' });
  private readonly labels = new Map<string, Label>();
  private readonly target = html('div', { class: 'label target-label', hidden: true });

  constructor() {
    this.element.append(this.target);
  }

  show(
    vehicles: readonly Vehicle[],
    looks: ReadonlyMap<string, Identity>,
    selected: ReadonlySet<string>,
    eye: Eye,
    groundZ: number,
  ): void {
    const seen = vehicles.flatMap((vehicle) => {
      const look = looks.get(vehicle.name);
      const place = vehicle.position && eye.project(vehicle.position);
      if (!look || !place || !vehicle.position) return [];
      const above = glyphRadius(vehicle, vehicle.position, eye) / eye.metresPerPixel(place.distance);
      return [{ vehicle, look, place, above: Math.min(above, 60) }];
    });
    for (const [name, label] of this.labels) {
      if (seen.some(({ vehicle }) => vehicle.name === name)) continue;
      label.element.remove();
      this.labels.delete(name);
    }
    // The nearest are placed first and so have the first choice.
    seen.sort((a, b) => a.place.distance - b.place.distance);
    const placed: Box[] = [];
    for (const { vehicle, look, place, above } of seen) {
      const label = this.label(vehicle.name, look);
      const picked = selected.has(vehicle.name);
      this.write(label, words(vehicle, picked, vehicles.length <= MOST_NAMES, groundZ), picked, vehicle.link.alive);
      const size = (label.size ??= { width: label.element.offsetWidth, height: label.element.offsetHeight });
      const others = seen.filter((each) => each.vehicle !== vehicle).map((each) => around(each.place));
      const sides = boxes(place, above + 3, size);
      const free = (box: Box) => ![...placed, ...others].some((taken) => overlap(taken, box));
      // Where it was is best: a label that hops is harder to follow than one that is a little in the way.
      const side = [label.side, ...sides.keys()].find((i) => free(sides[i]!)) ?? 0;
      const box = sides[side]!;
      placed.push(box);
      label.side = side;
      label.box = box;
      label.element.style.transform = `translate(${box.left.toFixed(1)}px, ${box.top.toFixed(1)}px)`;
    }
  }

  showTarget(point: Point | null, eye: Eye, groundZ: number): void {
    const place = point && eye.project([point[0], point[1], groundZ]);
    this.target.hidden = !place;
    if (!place || !point) return;
    const height = point[2] === null ? 'heights kept' : `${(point[2] - groundZ).toFixed(1)} m high`;
    setText(this.target, `${placeWords(point[0], point[1])} · ${height}`);
    this.target.style.transform = `translate(${place.x.toFixed(1)}px, ${(place.y + 20).toFixed(1)}px) translateX(-50%)`;
  }

  /** The vehicle whose label covers this place. */
  at(x: number, y: number): string | null {
    for (const [name, { box }] of this.labels) {
      if (box && x >= box.left && x <= box.left + box.width && y >= box.top && y <= box.top + box.height) return name;
    }
    return null;
  }

  private label(name: string, look: Identity): Label {
    const known = this.labels.get(name);
    if (known) {
      if (known.look !== look) {
        const fresh = badge(look);
        known.badge.replaceWith(fresh);
        Object.assign(known, { look, badge: fresh });
      }
      return known;
    }
    const text = html('span', { class: 'label-text' });
    const mark = badge(look);
    const element = html('div', { class: 'label' }, mark, text);
    this.element.append(element);
    const label: Label = { element, text, badge: mark, look, size: null, shown: '', box: null, side: 0 };
    this.labels.set(name, label);
    return label;
  }

  private write(label: Label, text: string, picked: boolean, alive: boolean): void {
    const shown = `${picked} ${alive} ${text}`;
    if (label.shown === shown) return;
    label.shown = shown;
    label.size = null;
    setText(label.text, text);
    label.text.hidden = text === '';
    label.element.classList.toggle('picked', picked);
    label.element.classList.toggle('lost', !alive);
  }
}

function words(vehicle: Vehicle, picked: boolean, roomForNames: boolean, groundZ: number): string {
  const words = roomForNames || picked ? [vehicle.name] : [];
  if (!vehicle.link.alive) {
    words.push(vehicle.link.age_ms === null ? 'silent' : `silent for ${durationWords(vehicle.link.age_ms)}`);
  } else if (picked && vehicle.position) {
    words.push(`${(vehicle.position[2] - groundZ).toFixed(1)} m`);
  }
  return words.join(' · ');
}

/** A place on the ground as a navigator says it. */
export function placeWords(x: number, y: number): string {
  return `${x.toFixed(1)} E  ${y.toFixed(1)} N`;
}

/** The places for a label of this size, best first: above, beside, below, and farther up. */
function boxes({ x, y }: { x: number; y: number }, gap: number, size: { width: number; height: number }): Box[] {
  const { width, height } = size;
  const [middle, level] = [x - width / 2, y - height / 2];
  return [
    { left: middle, top: y - gap - height, ...size },
    { left: x + gap, top: level, ...size },
    { left: x - gap - width, top: level, ...size },
    { left: middle, top: y + gap, ...size },
    { left: middle, top: y - gap - 2 * height, ...size },
    { left: middle, top: y - gap - 3 * height, ...size },
  ];
}

/** What a vehicle itself takes up. */
function around({ x, y }: { x: number; y: number }): Box {
  return { left: x - 8, top: y - 8, width: 16, height: 16 };
}

function overlap(a: Box, b: Box): boolean {
  return a.left < b.left + b.width && b.left < a.left + a.width && a.top < b.top + b.height && b.top < a.top + a.height;
}
