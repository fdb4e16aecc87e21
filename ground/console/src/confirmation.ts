/**
 * A question before an order that ends the whole swarm's mission where it is.
 */

import { html, setText } from './dom';
import { What } from './vocabulary';
import { orderName } from './words';

const QUESTIONS: Partial<Record<What, string>> = {
  [What.abort]: 'Everyone lands where it is, decided together. This ends the mission.',
  [What.land]: 'Every vehicle lands where it is. This ends the mission.',
};

export class Confirmation {
  private readonly title = html('h2', { id: 'end-title' });
  private readonly question = html('p', {});
  private readonly flying = html('p', { class: 'muted' });
  private readonly go = html('button', { type: 'button', class: 'command command-land' });
  private readonly dialog: HTMLDialogElement;
  private give: () => void = () => {};

  constructor() {
    const cancel = html('button', { type: 'button', class: 'command', autofocus: true }, 'Cancel');
    cancel.addEventListener('click', () => this.close());
    this.go.addEventListener('click', () => {
      this.close();
      this.give();
    });
    const buttons = html('div', { class: 'dialog-buttons' }, cancel, this.go);
    this.dialog = html('dialog', { class: 'confirm', 'aria-labelledby': 'end-title' }, this.title, this.question, this.flying, buttons);
    document.body.append(this.dialog);
  }

  /** Asks whether the order is to be given while so many vehicles fly. */
  ask(what: What, flying: number, give: () => void): void {
    this.give = give;
    setText(this.title, `${orderName(what)} all?`);
    setText(this.question, QUESTIONS[what] ?? '');
    setText(this.flying, flying === 1 ? 'One vehicle flies.' : `${flying} vehicles fly.`);
    setText(this.go, what === What.abort ? 'Abort the mission' : 'Land all');
    if (!this.dialog.open) this.dialog.showModal();
  }

  close(): void {
    this.dialog.close();
  }
}
