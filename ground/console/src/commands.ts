/**
 * The commands: what each button sends, and to whom.
 *
 * A safety order acts at once. Only launching asks again, as arming takes two steps.
 */

import { html, setText } from './dom';
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
  order(what: Exclude<Command, typeof What.goto>): void;
  placing(): void;
  everyone(): void;
}

export class Commands {
  private readonly to = html('span', { class: 'to-whom' });
  private readonly everyone = html('button', { type: 'button', class: 'link-button', hidden: true }, 'All vehicles');
  private readonly buttons = new Map<Command, HTMLButtonElement>();
  private readonly confirm: HTMLDialogElement;
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
    this.confirm = this.makeConfirm();
    document.body.append(this.confirm);
  }

  /** Does what pressing the button would do, if it can be pressed. */
  press(what: Command): void {
    if (this.buttons.get(what)?.disabled !== false) return;
    if (what === What.goto) this.events.placing();
    else if (what === What.launch) this.confirm.showModal();
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
    if (!enabled) this.confirm.close();
  }

  setPlacing(placing: boolean): void {
    this.buttons.get(What.goto)?.setAttribute('aria-pressed', String(placing));
  }

  private showEnabled(): void {
    for (const [what, button] of this.buttons) button.disabled = !this.live || (FOR_ALL.has(what) && !this.all);
  }

  private makeConfirm(): HTMLDialogElement {
    const cancel = html('button', { type: 'button', class: 'command', autofocus: true }, 'Cancel');
    const launch = (what: typeof What.launch | typeof What.launchTogether, words: string) => {
      const button = html('button', { type: 'button', class: 'command command-arm' }, words);
      button.addEventListener('click', () => {
        dialog.close();
        this.events.order(what);
      });
      return button;
    };
    const dialog = html(
      'dialog',
      { class: 'confirm', 'aria-labelledby': 'confirm-title' },
      html('h2', { id: 'confirm-title' }, 'Arm motors and take off?'),
      html('p', {}, html('strong', {}, 'All vehicles')),
      html('p', { class: 'muted' }, 'In turn: each when its own checks pass and the one before it is in the air. Together: all at once, when everyone is there and ready.'),
    );
    dialog.append(
      html('div', { class: 'dialog-buttons' }, cancel, launch(What.launchTogether, 'Take off together'), launch(What.launch, 'Take off in turn')),
    );
    cancel.addEventListener('click', () => dialog.close());
    return dialog;
  }
}
