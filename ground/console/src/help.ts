/**
 * The help: keys and gestures on one card.
 */

import { html } from './dom';

const KEYS: [keys: string[], does: string][] = [
  [['H'], 'hold'],
  [['R'], 'resume'],
  [['B'], 'return: back home'],
  [['L'], 'land'],
  [['G'], 'go to: then click the ground'],
  [['P'], 'play or pause a recording'],
  [['E'], 'draw a route for a vehicle: click its points on the ground'],
  [['Z'], 'draw a zone: click its corners on the ground'],
  [['1', '…', '9'], 'select a vehicle by its number (12: 1, then 2), with ⇧ add it'],
  [['0', 'A'], 'select all'],
  [['Esc'], 'leave a mode, then deselect'],
  [['F'], 'fit everything in'],
  [['W'], 'read why the selected vehicle does what it does'],
  [['T'], 'dark or light'],
  [['?'], 'this card'],
];
const GESTURES: [gesture: string, does: string][] = [
  ['Drag', 'orbit'],
  ['Right drag, arrows', 'pan'],
  ['Wheel', 'zoom'],
  ['Click', 'select a vehicle'],
  ['⇧ or Ctrl click', 'select one more'],
];

export class Help {
  private readonly dialog: HTMLDialogElement;

  constructor(opener: HTMLElement) {
    const close = html('button', { type: 'button', class: 'command', autofocus: true }, 'Close');
    const keys = KEYS.flatMap(([names, does]) => [html('dt', {}, ...names.map((name) => (name === '…' ? name : html('kbd', {}, name)))), html('dd', {}, does)]);
    const gestures = GESTURES.flatMap(([gesture, does]) => [html('dt', {}, gesture), html('dd', {}, does)]);
    this.dialog = html(
      'dialog',
      { class: 'help', 'aria-labelledby': 'help-title' },
      html('h2', { id: 'help-title' }, 'Keys'),
      html('dl', {}, ...keys),
      html('h2', {}, 'In the view'),
      html('dl', {}, ...gestures),
      html('p', { class: 'muted' }, 'Orders go to the selected vehicles, or to all if none is selected.'),
      html('div', { class: 'dialog-buttons' }, close),
    );
    document.body.append(this.dialog);
    opener.addEventListener('click', () => this.open());
    close.addEventListener('click', () => this.dialog.close());
    this.dialog.addEventListener('keydown', (event) => event.key === '?' && this.dialog.close());
  }

  open(): void {
    if (!this.dialog.open) this.dialog.showModal();
  }
}
