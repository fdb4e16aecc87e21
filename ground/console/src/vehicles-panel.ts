/**
 * The list of vehicles: two lines each, what it is and does, and a third if it warns.
 *
 * It is a list box, so that arrow keys walk it and a screen reader tells what is selected.
 */

import { badge } from './badge';
import { html, setAttribute, setText } from './dom';
import { type Identity, identities } from './identity';
import type { Fleet, Vehicle } from './protocol';
import type { Selection } from './selection';
import { durationWords, faultWords, spaced, waitingWords } from './words';

/** Below these a battery is low or nearly empty. */
const BATTERY_LOW = 0.3;
const BATTERY_CRITICAL = 0.15;

export class VehiclesPanel {
  private readonly list = html('ul', {
    class: 'fleet',
    role: 'listbox',
    'aria-multiselectable': 'true',
    'aria-label': 'Vehicles',
  });
  private readonly empty = html('p', { class: 'empty' }, 'The station has named no vehicle yet.');
  private readonly rows = new Map<string, Row>();
  private looks: ReadonlyMap<string, Identity> = new Map();
  private groundZ = 0;

  constructor(
    body: HTMLElement,
    private readonly note: HTMLElement,
    private readonly selection: Selection,
  ) {
    const heads = ['Vehicle', 'Height', 'Speed', 'Battery', 'Link'].map((head) => html('span', {}, head));
    body.append(html('div', { class: 'fleet-heads', 'aria-hidden': 'true' }, ...heads), this.list, this.empty);
    this.list.addEventListener('click', (event) => {
      const row = (event.target as Element).closest<HTMLElement>('[data-vehicle]');
      if (row) this.pick(row, event.shiftKey || event.ctrlKey || event.metaKey);
    });
    this.list.addEventListener('keydown', (event) => this.key(event));
  }

  setGround(z: number): void {
    this.groundZ = z;
  }

  show(fleet: Fleet): void {
    const names = fleet.vehicles.map(({ name }) => name);
    const same = names.length === this.rows.size && [...this.rows.keys()].every((name, i) => name === names[i]);
    if (!same) {
      this.looks = identities(names);
      this.rows.clear();
      for (const name of names) this.rows.set(name, new Row(name, this.looks.get(name)!));
      this.list.replaceChildren(...[...this.rows.values()].map((row) => row.element));
      this.showSelection();
    }
    for (const vehicle of fleet.vehicles) this.rows.get(vehicle.name)?.show(vehicle, this.groundZ);
    this.empty.hidden = names.length > 0;
    setText(this.note, countWords(fleet.vehicles));
  }

  showSelection(): void {
    const rows = [...this.rows];
    rows.forEach(([name, { element }]) => setAttribute(element, 'aria-selected', String(this.selection.has(name))));
    // One row is reached by Tab, the others from there by arrows.
    const reached = rows.find(([, { element }]) => element === document.activeElement) ?? rows.find(([name]) => this.selection.has(name)) ?? rows[0];
    rows.forEach((row) => (row[1].element.tabIndex = row === reached ? 0 : -1));
    // There is less room for the list while the reasons of a vehicle are shown.
    if (reached && this.selection.has(reached[0])) reached[1].element.scrollIntoView({ block: 'nearest' });
  }

  private key(event: KeyboardEvent): void {
    const row = (event.target as Element).closest<HTMLElement>('[data-vehicle]');
    if (!row || event.altKey || event.ctrlKey || event.metaKey) return;
    const rows = [...this.rows.values()].map(({ element }) => element);
    const at = rows.indexOf(row as HTMLLIElement);
    const next = { ArrowDown: at + 1, ArrowUp: at - 1, Home: 0, End: rows.length - 1 }[event.key];
    if (next !== undefined) {
      const to = rows[Math.min(rows.length - 1, Math.max(0, next))]!;
      rows.forEach((each) => (each.tabIndex = each === to ? 0 : -1));
      to.focus();
    } else if (event.key === ' ' || event.key === 'Enter') {
      this.pick(row, event.key === ' ' || event.shiftKey);
    } else {
      return;
    }
    event.preventDefault();
  }

  private pick(row: HTMLElement, more: boolean): void {
    const name = row.dataset.vehicle ?? '';
    if (more) this.selection.toggle(name);
    else this.selection.pick(name);
  }
}

/** One vehicle's lines. Its elements stay; only what they say changes. */
class Row {
  readonly element: HTMLLIElement;
  private readonly mode = html('span', { class: 'mode' });
  private readonly holder = html('span', { class: 'holder' });
  private readonly height = html('span', { class: 'number' });
  private readonly speed = html('span', { class: 'number' });
  private readonly charge = html('span', { class: 'charge' });
  private readonly battery = html('span', { class: 'battery' }, html('span', { class: 'cell', 'aria-hidden': 'true' }, this.charge));
  private readonly percent = html('span', { class: 'number' });
  private readonly link = html('span', { class: 'link' });
  private readonly task = html('span', { class: 'task' });
  private readonly waiting = html('span', { class: 'waiting' });
  private readonly notes = html('span', { class: 'notes' });

  constructor(name: string, look: Identity) {
    this.battery.append(this.percent);
    this.element = html(
      'li',
      { class: 'vehicle', role: 'option', tabindex: '-1', 'aria-selected': 'false', 'data-vehicle': name },
      badge(look),
      html('span', { class: 'who' }, html('span', { class: 'name' }, name), this.mode),
      this.height,
      this.speed,
      this.battery,
      this.link,
      html('span', { class: 'doing' }, this.task, this.waiting, this.holder),
      this.notes,
    );
  }

  show(vehicle: Vehicle, groundZ: number): void {
    const { element } = this;
    const link = linkState(vehicle);
    setAttribute(element, 'data-link', link);
    setAttribute(element, 'data-mode', vehicle.heard ? vehicle.mode : '');
    setAttribute(element, 'data-mission', vehicle.mission);
    setText(this.mode, vehicle.heard ? spaced(vehicle.mode) : '');

    setText(this.holder, vehicle.holder);
    setAttribute(this.holder, 'title', vehicle.holder ? `${vehicle.holder} commands it${vehicle.asked_by && `; ${vehicle.asked_by} asks for it`}` : null);
    setAttribute(this.holder, 'data-asked', vehicle.asked_by || null);
    this.holder.hidden = !vehicle.holder;

    const speed = vehicle.velocity && Math.hypot(...vehicle.velocity);
    setText(this.height, vehicle.position ? `${(vehicle.position[2] - groundZ).toFixed(1)} m` : '–');
    setText(this.speed, vehicle.heard && speed !== null ? `${speed.toFixed(1)} m/s` : '–');
    this.showBattery(vehicle.heard ? vehicle.battery : null);
    setText(this.link, linkWords(vehicle, link));

    setText(this.task, taskWords(vehicle, link));
    setAttribute(this.task, 'title', this.task.textContent);
    const waiting = link !== 'alive' ? '' : vehicle.heard ? waitingWords(vehicle.waiting_for) : faultWords(vehicle.checks);
    setText(this.waiting, waiting);
    setAttribute(this.waiting, 'title', waiting || null);
    this.waiting.hidden = !waiting;

    const notes = vehicle.notes.join(' · ');
    setText(this.notes, notes);
    this.notes.hidden = !notes;
  }

  private showBattery(fraction: number | null): void {
    const level = fraction === null ? 'unknown' : fraction < BATTERY_CRITICAL ? 'critical' : fraction < BATTERY_LOW ? 'low' : 'good';
    setAttribute(this.battery, 'data-level', level);
    const width = `${Math.round(Math.min(1, Math.max(0, fraction ?? 0)) * 100)}%`;
    if (this.charge.style.width !== width) this.charge.style.width = width;
    setText(this.percent, fraction === null ? '–' : `${level === 'good' ? '' : '! '}${Math.round(fraction * 100)} %`);
  }
}

type LinkState = 'alive' | 'lost' | 'unheard';

/** A vehicle that lives may not know yet where it is, and then it is not heard. */
function linkState({ heard, link }: Vehicle): LinkState {
  return link.alive ? 'alive' : heard ? 'lost' : 'unheard';
}

function linkWords({ link: { age_ms: ageMs } }: Vehicle, link: LinkState): string {
  if (link === 'unheard') return 'never heard';
  if (link === 'lost') return 'link lost';
  return ageMs === null ? 'alive' : durationWords(ageMs);
}

function taskWords(vehicle: Vehicle, link: LinkState): string {
  if (link === 'unheard') return 'No word from it since the station started';
  if (link === 'lost') {
    const { age_ms: ageMs } = vehicle.link;
    const last = vehicle.task || spaced(vehicle.mode);
    return [ageMs === null ? 'Silent' : `Silent for ${durationWords(ageMs)}`, last && `last: ${last}`].filter(Boolean).join(' · ');
  }
  if (!vehicle.heard) return 'Does not know yet where it is';
  const done = { complete: '✓ mission complete', failed: '✕ mission failed', under_way: '' }[vehicle.mission ?? 'under_way'];
  return [done, vehicle.task, vehicle.armed ? '' : 'disarmed'].filter(Boolean).join(' · ');
}

/** `8, of which 1 silent`. */
function countWords(vehicles: readonly Vehicle[]): string {
  const count = (state: LinkState): number => vehicles.filter((vehicle) => linkState(vehicle) === state).length;
  const [silent, unheard] = [count('lost'), count('unheard')];
  const parts = [`${vehicles.length}`];
  if (silent > 0) parts.push(`${silent} silent`);
  if (unheard > 0) parts.push(`${unheard} never heard`);
  return parts.join(' · ');
}
