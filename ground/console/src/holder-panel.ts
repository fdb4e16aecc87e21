/**
 * Who holds the vehicles that orders are for, and buttons to ask for them, take them, give them and let them go.
 */

import { html } from './dom';
import { type Holding, holdings } from './holding';
import type { Vehicle } from './protocol';
import { What } from './vocabulary';
import { nameWords } from './words';

export type HandOver = (what: typeof What.ask | typeof What.take | typeof What.give | typeof What.release, vehicles: string[], name?: string) => void;

export class HolderPanel {
  private readonly list = html('ul', { class: 'holdings', 'aria-label': 'Who holds them', 'aria-live': 'polite' });
  /** What is shown, so that a button stays under the pointer while nothing changes. */
  private shown = '';

  constructor(
    root: HTMLElement,
    private readonly handOver: HandOver,
  ) {
    root.append(this.list);
  }

  /** `mayNot` says why whoever sits here may take no vehicle, if so. */
  show(vehicles: readonly Vehicle[], me: string | null, mayNot: string | null): void {
    const found = holdings(vehicles.filter(({ heard }) => heard));
    const shown = JSON.stringify([found, me, mayNot]);
    if (shown === this.shown) return;
    this.shown = shown;
    this.list.replaceChildren(...found.map((holding) => this.line(holding, found.length > 1, me, mayNot)));
  }

  private line(holding: Holding, named: boolean, me: string | null, mayNot: string | null): HTMLLIElement {
    const { holder, vehicles, askers } = holding;
    const which = named ? ` of ${nameWords(vehicles, 3)}` : '';
    const button = (words: string, title: string, press: () => void) => {
      const made = html('button', { type: 'button', class: 'link-button', title: mayNot ?? title, disabled: mayNot !== null }, words);
      made.addEventListener('click', press);
      return made;
    };
    const line = (words: string, ...buttons: HTMLElement[]) =>
      html('li', { class: 'holding', 'data-holder': holder }, html('span', {}, words), ...buttons);
    if (!holder) return line(`In command${which}: nobody, until the first order`);
    if (holder === me) {
      const gives = askers.map((asker) => button(`Give to ${asker}`, `${asker} asks for it`, () => this.handOver(What.give, vehicles, asker)));
      const asked = askers.length > 0 ? ` · ${askers.join(', ')} asks` : '';
      return line(`In command${which}: you${asked}`, ...gives, button('Release', 'Command them no more', () => this.handOver(What.release, vehicles)));
    }
    const asking = me !== null && askers.includes(me);
    return line(
      `In command${which}: ${holder}`,
      asking ? html('span', { class: 'muted' }, 'asked') : button('Ask', `Ask ${holder} for it`, () => this.handOver(What.ask, vehicles)),
      button('Take over', `Command it yourself; ${holder} is told`, () => this.handOver(What.take, vehicles)),
    );
  }
}
