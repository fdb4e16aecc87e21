/**
 * The scripts that run on vehicles: one line each, with a button that takes it back everywhere; and a button that sends
 * another from a file.
 */

import { html } from './dom';
import type { Fleet } from './protocol';
import { nameWords } from './words';

export class ScriptsPanel {
  private readonly list = html('ul', { class: 'scripts', 'aria-label': 'Scripts that run', hidden: true });
  /** What is shown, so that a button stays under the pointer while nothing changes. */
  private shown = '';

  constructor(
    body: HTMLElement,
    private readonly withdraw: (script: string, vehicles: string[]) => void,
    chosen: (file: File) => void,
  ) {
    const file = html('input', { type: 'file', accept: '.toml,.json', class: 'unseen', tabindex: '-1', 'aria-hidden': 'true' });
    const send = html('button', { class: 'link-button', type: 'button', title: 'A b-thread as a TOML or JSON file' }, 'Send a script…');
    send.addEventListener('click', () => file.click());
    file.addEventListener('change', () => {
      const [picked] = file.files ?? [];
      if (picked) chosen(picked);
      // So that the same file can be chosen again.
      file.value = '';
    });
    body.append(this.list, html('p', { class: 'send-script' }, send, file));
  }

  show(fleet: Fleet): void {
    const vehicles = new Map<string, string[]>();
    for (const { name, scripts } of fleet.vehicles) {
      for (const script of scripts) vehicles.set(script, [...(vehicles.get(script) ?? []), name]);
    }
    const lines = [...vehicles].sort(([a], [b]) => a.localeCompare(b));
    const shown = JSON.stringify(lines);
    if (shown === this.shown) return;
    this.shown = shown;
    this.list.hidden = lines.length === 0;
    this.list.replaceChildren(...lines.map(([script, names]) => this.line(script, names)));
  }

  private line(script: string, names: string[]): HTMLLIElement {
    const button = html('button', { class: 'link-button', type: 'button', 'data-withdraw': script }, 'Withdraw');
    button.addEventListener('click', () => this.withdraw(script, names));
    return html('li', { class: 'script', 'data-script': script }, html('span', {}, `${script}: ${nameWords(names)}`), button);
  }
}
