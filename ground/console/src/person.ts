/**
 * Who sits here, and what they may do: a certificate says so, or whoever sits here does, once; this browser remembers it.
 */

import { html, setText } from './dom';
import type { You } from './protocol';
import { FOR_SAFETY, type What } from './vocabulary';

const KEY = 'skein-name';
const LONGEST = 48;

const ROLES: Record<You['role'], string> = {
  observer: 'an observer, who sees and orders nothing',
  safety: 'there for safety: to hold, to return and to land',
  operator: 'an operator',
};

export class Person {
  private you: You = { type: 'you', tag: '', name: null, role: 'operator', certified: false };
  private readonly button = html('button', { type: 'button', class: 'person' });

  /** `say` tells the station a name, `refuse` whoever sits here why they may not do something. */
  constructor(
    root: HTMLElement,
    private readonly say: (name: string) => void,
    private readonly refuse: (why: string) => void,
  ) {
    this.button.addEventListener('click', () => this.ask(() => {}));
    root.append(this.button);
    this.show();
  }

  get name(): string | null {
    return this.you.name;
  }

  /** Introduces whoever sits here to a station that has just been reached. */
  introduce(): void {
    const name = recall();
    if (name && !this.you.certified) this.say(name);
  }

  hear(you: You): void {
    this.you = you;
    this.show();
  }

  /** Why they may not order this, if so. */
  mayNot(what: What): string | null {
    const { role } = this.you;
    if (role === 'operator' || (role === 'safety' && FOR_SAFETY.has(what))) return null;
    return `By your certificate you are ${ROLES[role]}`;
  }

  /** Does `then`, if they may, once the station can know by whom; what is for safety waits for no name. */
  named(what: What, then: () => void): void {
    const why = this.mayNot(what);
    if (why) this.refuse(why);
    else if (this.you.name || FOR_SAFETY.has(what)) then();
    else this.ask(then);
  }

  private show(): void {
    const { name, role, certified } = this.you;
    setText(this.button, certified ? `${name ?? ''} · ${role}` : (name ?? 'Who are you?'));
    this.button.disabled = certified;
    this.button.title = certified ? `By your certificate you are ${ROLES[role]}` : 'Your name, which every order of yours tells';
  }

  private ask(then: () => void): void {
    const cancel = html('button', { type: 'button', class: 'command' }, 'Cancel');
    const field = html('input', { type: 'text', maxlength: String(LONGEST), autocomplete: 'name', spellcheck: 'false', placeholder: 'Anna' });
    field.required = true;
    field.pattern = '[^\\/#]*[^\\/#\\s][^\\/#]*';
    field.value = this.you.name ?? '';
    const form = html(
      'form',
      { method: 'dialog' },
      html('h2', { id: 'person-title' }, 'Who are you?'),
      html('p', { class: 'muted' }, 'Every order tells who gave it, and a vehicle takes the orders of one person at a time. This browser remembers your name.'),
      html('label', { class: 'parameter' }, html('strong', {}, 'Name'), field),
      html('div', { class: 'dialog-buttons' }, cancel, html('button', { class: 'command command-send' }, 'That is me')),
    );
    const dialog = html('dialog', { class: 'script-dialog', 'aria-labelledby': 'person-title' }, form);
    cancel.addEventListener('click', () => dialog.close());
    dialog.addEventListener('close', () => dialog.remove());
    form.addEventListener('submit', () => {
      const name = field.value.trim();
      remember(name);
      this.say(name);
      then();
    });
    document.body.append(dialog);
    dialog.showModal();
  }
}


function recall(): string | null {
  try {
    return window.localStorage.getItem(KEY);
  } catch {
    return null;
  }
}

/** Storage may be forbidden; then the name holds until the page is closed. */
function remember(name: string): void {
  try {
    window.localStorage.setItem(KEY, name);
  } catch {
    // It is asked for again next time.
  }
}
