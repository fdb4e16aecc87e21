/**
 * A route by hand: a mode in which clicks on the ground add points, a field says how high each is, and the whole is
 * rehearsed or sent to one vehicle. The way that a vehicle still has to fly can be taken up and changed.
 */

import type { Place } from './drawing';
import { html, setText } from './dom';
import type { Vec3 } from './protocol';

/** The station takes no longer ones. */
export const MOST_POINTS = 64;

export class Routing {
  private readonly hint = html('span', { class: 'placing-hint', role: 'status' });
  private readonly vehicle = html('select', { 'aria-label': 'Who flies it' });
  private readonly height = html('input', { type: 'number', inputmode: 'decimal', step: 'any', value: '5', 'aria-label': 'Height of the next point, in metres above ground' });
  private readonly rehearse = html('button', { type: 'button', class: 'command' }, 'Rehearse');
  private readonly send = html('button', { type: 'button', class: 'command command-draw' }, 'Send');
  private readonly bar: HTMLElement;
  private points: Vec3[] = [];
  private on = false;

  constructor(
    stage: HTMLElement,
    private readonly events: {
      changed(on: boolean, vehicle: string, points: readonly Vec3[]): void;
      rehearse(vehicle: string, points: readonly Vec3[]): void;
      send(vehicle: string, points: readonly Vec3[]): void;
      /** The points that a vehicle still has to fly, as it has told. */
      told(vehicle: string): readonly Vec3[];
    },
  ) {
    const link = (word: string, title: string) => html('button', { type: 'button', class: 'link-button', title }, word);
    const [undo, edit, cancel] = [link('Undo', 'Take the last point away'), link('Its own', 'Begin with what the vehicle still has to fly'), link('Cancel', 'Leave (Esc)')];
    undo.addEventListener('click', () => this.change(this.points.slice(0, -1)));
    edit.addEventListener('click', () => this.change([...this.events.told(this.vehicle.value)]));
    cancel.addEventListener('click', () => this.set(false));
    this.vehicle.addEventListener('input', () => this.show());
    this.height.addEventListener('input', () => this.show());
    this.rehearse.addEventListener('click', () => this.events.rehearse(this.vehicle.value, this.points));
    this.send.addEventListener('click', () => {
      const [vehicle, points] = [this.vehicle.value, this.points];
      this.set(false);
      this.events.send(vehicle, points);
    });
    this.bar = html(
      'div',
      { class: 'placing-bar drawing-bar routing-bar', hidden: true },
      html('label', {}, 'Route for', this.vehicle),
      html('label', {}, 'Height', this.height, 'm'),
      this.hint,
      undo,
      edit,
      this.rehearse,
      this.send,
      cancel,
    );
    stage.append(this.bar);
  }

  get active(): boolean {
    return this.on;
  }

  /** `vehicles` are those that may fly it; `selected` is taken first. */
  set(on: boolean, vehicles: readonly string[] = [], selected?: string): void {
    if (on === this.on) return;
    this.on = on;
    this.bar.hidden = !on;
    if (on) {
      this.vehicle.replaceChildren(...vehicles.map((name) => html('option', { value: name }, name)));
      if (selected) this.vehicle.value = selected;
    }
    this.change([]);
  }

  /** A place on the ground; `groundZ` is the ground's height. */
  add([x, y]: Place, groundZ: number): void {
    const metres = this.metres;
    if (metres !== null && this.points.length < MOST_POINTS) this.change([...this.points, [x, y, groundZ + metres]]);
  }

  private get metres(): number | null {
    const { value, validity } = this.height;
    const metres = Number(value);
    return validity.badInput || value.trim() === '' || !Number.isFinite(metres) || metres <= 0 ? null : metres;
  }

  private change(points: Vec3[]): void {
    this.points = points;
    this.show();
  }

  private show(): void {
    const isReady = this.points.length > 0 && this.vehicle.value !== '';
    this.rehearse.disabled = this.send.disabled = !isReady;
    setText(this.hint, this.metres === null ? 'The height must be a number of metres above 0' : routeWords(this.points));
    this.events.changed(this.on, this.vehicle.value, this.points);
  }
}

/** `3 points, 42 m, 3 to 8 m high`. */
export function routeWords(points: readonly Vec3[]): string {
  if (points.length === 0) return 'Click its points on the ground';
  const length = points.slice(1).reduce((sum, [x, y, z], index) => {
    const [fromX, fromY, fromZ] = points[index]!;
    return sum + Math.hypot(x - fromX, y - fromY, z - fromZ);
  }, 0);
  const heights = points.map(([, , z]) => z);
  const [low, high] = [Math.min(...heights), Math.max(...heights)].map((metres) => metres.toFixed(1));
  const heightWords = low === high ? `${low} m high` : `${low} to ${high} m high`;
  return points.length === 1 ? `1 point, ${heightWords}` : `${points.length} points, ${length.toFixed(0)} m, ${heightWords}`;
}
