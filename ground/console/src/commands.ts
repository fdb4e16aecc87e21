/**
 * The commands: what each button sends, and to whom.
 *
 * A safety order acts at once, but for what brings all down: see `confirmation.ts`. Launching asks again too: see
 * `launch-dialog.ts`.
 */

import { html, setAttribute, setText } from './dom';
import type { Command } from './protocol';
import { FOR_ALL, What } from './vocabulary';
import { orderName } from './words';

const BUTTONS: { what: Command; key: string; title: string }[] = [
  { what: What.hold, key: 'H', title: 'Stop and stay there until resumed' },
  { what: What.resume, key: 'R', title: 'Go on after a hold' },
  { what: What.return, key: 'B', title: 'Fly back home and land there' },
  { what: What.land, key: 'L', title: 'Land here and now' },
  { what: What.goto, key: 'G', title: 'Fly to a place you click' },
  { what: What.abort, key: '', title: 'Everyone lands where it is, decided together' },
  { what: What.launch, key: '', title: 'Arm and take off; asks again first' },
];

export interface CommandEvents {
  order(what: Exclude<Command, typeof What.goto | typeof What.launch>): void;
  launch(): void;
  placing(): void;
  everyone(): void;
}

export class Commands {
  private readonly to = html('span', { class: 'to-whom' });
  private readonly everyone = html('button', { type: 'button', class: 'link-button', hidden: true }, 'All vehicles');
  private readonly buttons = new Map<Command, HTMLButtonElement>();
  private mayNot: (what: Command) => string | null = () => null;
  private live = false;
  private all = true;

  constructor(
    root: HTMLElement,
    private readonly events: CommandEvents,
  ) {
    const row = html('div', { class: 'buttons', role: 'group', 'aria-label': 'Orders to give' });
    for (const { what, key, title } of BUTTONS) {
      const hint = key ? [html('kbd', { 'aria-hidden': 'true' }, key)] : [];
      const button = html('button', { type: 'button', class: `command command-${what}`, title, disabled: true }, orderName(what), ...hint);
      button.addEventListener('click', () => this.press(what));
      this.buttons.set(what, button);
      row.append(button);
    }
    this.everyone.addEventListener('click', () => events.everyone());
    const line = html('p', { class: 'addressees', 'aria-live': 'polite' }, html('span', { class: 'to' }, 'To'), this.to, this.everyone);
    root.append(line, row);
  }

  /** Does what pressing the button would do, if it can be pressed. */
  press(what: Command): void {
    if (this.buttons.get(what)?.disabled !== false) return;
    if (what === What.goto) this.events.placing();
    else if (what === What.launch) this.events.launch();
    else this.events.order(what);
  }

  setAddressees(words: string, all: boolean): void {
    setText(this.to, words);
    this.to.title = words;
    this.everyone.hidden = all;
    this.all = all;
    this.showEnabled();
  }

  setEnabled(enabled: boolean): void {
    this.live = enabled;
    this.showEnabled();
  }

  /** `mayNot` says why whoever sits here may not give an order, if so. */
  setRights(mayNot: (what: Command) => string | null): void {
    this.mayNot = mayNot;
    this.showEnabled();
  }

  setPlacing(placing: boolean): void {
    this.buttons.get(What.goto)?.setAttribute('aria-pressed', String(placing));
  }

  private showEnabled(): void {
    for (const { what, title } of BUTTONS) {
      const [button, mayNot] = [this.buttons.get(what)!, this.mayNot(what)];
      button.disabled = !this.live || mayNot !== null || (FOR_ALL.has(what) && !this.all);
      setAttribute(button, 'title', mayNot ?? title);
    }
  }
}
