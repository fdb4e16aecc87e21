/**
 * What the operator must notice: banners for a state that lasts, notices for what went wrong once.
 */

import { html, setAttribute, setText } from './dom';

const NOTICE_MS = 12_000;
const MOST_NOTICES = 3;

/** A line over the view for as long as a state lasts. */
export class Banner {
  private readonly element: HTMLElement;

  constructor(parent: HTMLElement, role: 'alert' | 'status') {
    this.element = html('p', { class: 'banner', role, hidden: true });
    parent.append(this.element);
  }

  show(words: string, kind: 'bad' | 'warn' | 'good'): void {
    this.element.hidden = false;
    setAttribute(this.element, 'data-kind', kind);
    setText(this.element, words);
  }

  hide(): void {
    this.element.hidden = true;
  }
}

export class Notices {
  constructor(private readonly root: HTMLElement) {}

  show(words: string): void {
    const close = html('button', { type: 'button', class: 'link-button' }, 'Close');
    const notice = html('div', { class: 'notice' }, html('p', {}, words), close);
    const remove = () => notice.remove();
    close.addEventListener('click', remove);
    window.setTimeout(remove, NOTICE_MS);
    this.root.append(notice);
    while (this.root.childElementCount > MOST_NOTICES) this.root.firstElementChild?.remove();
  }
}
