/**
 * The outcome of a rehearsal: the fleet flown on from here in simulation.
 */

import { html } from './dom';
import type { Range, Rehearsal } from './protocol';

export class RehearsalDialog {
  private readonly body = html('div', {});
  private readonly send = html('button', { type: 'button', class: 'command command-draw' }, 'Send');
  private readonly dialog = html('dialog', { class: 'confirm rehearsal', 'aria-labelledby': 'rehearsal-title' });
  private give: (() => void) | null = null;

  constructor() {
    const close = html('button', { type: 'button', class: 'command', autofocus: true }, 'Close');
    close.addEventListener('click', () => this.close());
    this.send.addEventListener('click', () => {
      const give = this.give;
      this.close();
      give?.();
    });
    this.dialog.append(this.body, html('div', { class: 'dialog-buttons' }, close, this.send));
    document.body.append(this.dialog);
  }

  /** It is being flown. `give` sends what is rehearsed, if that is not yet sent. */
  wait(give: (() => void) | null): void {
    this.give = give;
    this.send.hidden = true;
    this.say('Rehearsing…', html('p', { class: 'muted', role: 'status' }, 'The fleet is flown on from here in simulation, three times. Nobody is ordered anything.'));
  }

  /** Whoever has closed the dialog meanwhile does not want to know. */
  show(rehearsal: Rehearsal): void {
    if (!this.dialog.open) return;
    this.send.hidden = this.give === null;
    const flights = rehearsal.flights;
    const rows = rehearsal.vehicles.map((each) => {
      const notes = [...each.fails.map(({ why, seeds }) => `${seeds} of ${flights}: ${why}`), ...each.waits.filter(({ mean_s }) => mean_s >= 0.5).map(({ waits_for, mean_s }) => `waits ${mean_s.toFixed(0)} s for ${waits_for}`)];
      return html(
        'tr',
        { 'data-vehicle': each.vehicle },
        html('th', { scope: 'row' }, each.vehicle),
        html('td', { class: each.arrives === flights ? '' : 'doubt' }, `${each.arrives} of ${flights}`),
        html('td', {}, secondsWords(each.lands_s)),
        html('td', {}, each.battery ? `${(each.battery.least * 100).toFixed(0)} %` : '–'),
        html('td', { class: 'notes' }, notes.join('; ')),
      );
    });
    const head = html('tr', {}, ...['Vehicle', 'Arrives', 'Lands after', 'Energy left', ''].map((word) => html('th', { scope: 'col' }, word)));
    const left = Object.entries(rehearsal.left_out).map(([vehicle, why]) => html('p', { class: 'muted' }, `${vehicle} has no part in it: it ${why}.`));
    this.say(
      rehearsal.succeeded ? 'Everyone arrives' : 'Not everyone arrives',
      html('div', { class: 'rehearsal-rows' }, html('table', {}, html('thead', {}, head), html('tbody', {}, ...rows))),
      ...left,
      html('p', { class: rehearsal.succeeded ? '' : 'doubt' }, summaryWords(rehearsal)),
    );
  }

  /** There is no answer, and why. */
  fail(why: string): void {
    if (!this.dialog.open) return;
    this.send.hidden = true;
    this.say('Not rehearsed', html('p', { class: 'doubt' }, why));
  }

  close(): void {
    this.give = null;
    this.dialog.close();
  }

  private say(title: string, ...words: HTMLElement[]): void {
    this.body.replaceChildren(html('h2', { id: 'rehearsal-title' }, title), ...words);
    if (!this.dialog.open) this.dialog.showModal();
  }
}

/** `20 to 25 s`; a dash of none. */
export function secondsWords(range: Range | null): string {
  if (!range) return '–';
  const [least, most] = [range.least.toFixed(0), range.most.toFixed(0)];
  return least === most ? `${least} s` : `${least} to ${most} s`;
}

/** The nearest moment, the nearest obstacle, and what collides. */
export function summaryWords({ nearest, clearance_m, collisions }: Rehearsal): string {
  const [first] = nearest;
  const [obstacles, vehicles] = collisions;
  const parts = [
    first ? `Nearest: ${first.who.join(' and ')}, ${first.distance_m.toFixed(1)} m after ${first.at_s.toFixed(0)} s` : 'Nobody is near anybody',
    ...(clearance_m === null ? [] : [`an obstacle ${clearance_m.toFixed(1)} m from a hull`]),
    ...(obstacles + vehicles > 0 ? [`${obstacles} collisions with obstacles, ${vehicles} between vehicles`] : []),
  ];
  return `${parts.join('; ')}.`;
}
