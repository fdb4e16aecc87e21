/**
 * A launch, in two steps: the station says who would take off and which checks do not pass, and whoever launches confirms
 * it in time.
 */

import { html, setText } from './dom';
import type { Offer } from './protocol';
import { What } from './vocabulary';

type Launch = typeof What.launch | typeof What.launchTogether;

const TITLES: Record<Launch, string> = { launch: 'Take off in turn', launch_together: 'Take off together' };

export class LaunchDialog {
  private readonly body = html('div', {});
  private readonly buttons = html('div', { class: 'dialog-buttons' });
  private readonly dialog = html('dialog', { class: 'confirm', 'aria-labelledby': 'confirm-title' }, this.body, this.buttons);
  private clock = 0;

  /** `ask` asks the station what a launch would launch; `confirm` returns the token of its answer. */
  constructor(
    private readonly ask: (what: Launch) => void,
    private readonly confirm: (what: Launch, token: string) => void,
  ) {
    this.dialog.addEventListener('close', () => window.clearInterval(this.clock));
    document.body.append(this.dialog);
  }

  open(): void {
    this.say('Arm motors and take off?', html('p', {}, html('strong', {}, 'All vehicles')), html('p', { class: 'muted' }, 'In turn: each when its own checks pass and the one before it is in the air. Together: all at once, when everyone is there and ready.'));
    this.offerButtons(...([What.launchTogether, What.launch] as const).map((what) => this.button(TITLES[what], () => this.ask(what))));
    if (!this.dialog.open) this.dialog.showModal();
  }

  close(): void {
    this.dialog.close();
  }

  /** The station says who would take off. Whoever has closed the dialog meanwhile does not want to know. */
  show(offer: Offer): void {
    if (!this.dialog.open) return;
    const doubtful = offer.vehicles.filter(({ doubts }) => doubts.length > 0).length;
    const list = html(
      'ul',
      { class: 'candidates' },
      ...offer.vehicles.map(({ name, task, doubts }) =>
        html('li', { 'data-vehicle': name }, html('span', { class: 'name' }, name), html('span', { class: 'muted' }, task || 'task not told'), ...doubts.map((doubt) => html('span', { class: 'doubt' }, doubt))),
      ),
    );
    const ready = doubtful === 0 ? 'All checks pass.' : `${doubtful} of ${offer.vehicles.length} do not pass all checks; those wait on the ground until they do.`;
    this.say(`${TITLES[offer.what]}: ${offer.vehicles.length === 1 ? 'one vehicle' : `${offer.vehicles.length} vehicles`}`, list, html('p', { class: doubtful ? 'doubt' : 'muted' }, ready));
    const go = this.button('', () => {
      this.dialog.close();
      this.confirm(offer.what, offer.token);
    });
    this.offerButtons(go);
    const until = performance.now() + offer.lasts_s * 1000;
    const count = () => {
      const left = Math.ceil((until - performance.now()) / 1000);
      go.disabled = left <= 0;
      setText(go, left > 0 ? `Arm and take off (${left} s)` : 'Too late: ask again');
    };
    window.clearInterval(this.clock);
    this.clock = window.setInterval(count, 200);
    count();
  }

  private say(title: string, ...words: HTMLElement[]): void {
    this.body.replaceChildren(html('h2', { id: 'confirm-title' }, title), ...words);
  }

  private offerButtons(...buttons: HTMLElement[]): void {
    const cancel = html('button', { type: 'button', class: 'command', autofocus: true }, 'Cancel');
    cancel.addEventListener('click', () => this.dialog.close());
    this.buttons.replaceChildren(cancel, ...buttons);
    cancel.focus();
  }

  private button(words: string, press: () => void): HTMLButtonElement {
    const button = html('button', { type: 'button', class: 'command command-arm' }, words);
    button.addEventListener('click', press);
    return button;
  }
}
