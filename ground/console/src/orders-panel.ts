/**
 * What has become of the operator's orders: the newest with each vehicle's answer, the earlier in a line each.
 */

import { badge } from './badge';
import { html, setAttribute, setText } from './dom';
import { identities } from './identity';
import { orderState, orderSummary } from './order-summary';
import type { Answer, Order } from './protocol';
import { clockWords, durationWords } from './words';

const MARKS: Record<Answer['state'], string> = { acknowledged: '✓', pending: '…', missing: '?', refused: '✕' };

export class OrdersPanel {
  private readonly summary = html('p', { class: 'summary' });
  private readonly chips = html('ul', { class: 'chips', 'aria-live': 'off', 'aria-label': 'Answers' });
  /** Told politely: the summary is read out when it changes, not every chip. */
  private readonly newest = html('div', { class: 'newest', 'aria-live': 'polite' }, this.summary, this.chips);
  private readonly earlierList = html('ol', { class: 'earlier-list', reversed: true });
  private readonly earlierHead = html('summary', {});
  private readonly earlier = html('details', { class: 'earlier', hidden: true }, this.earlierHead, this.earlierList);
  private fleet: readonly string[] = [];
  private orders: readonly Order[] = [];

  constructor(root: HTMLElement) {
    root.append(this.newest, this.earlier);
    setText(this.summary, 'No order given yet');
    document.addEventListener('pointerdown', (event) => {
      if (!this.earlier.contains(event.target as Node)) this.earlier.open = false;
    });
  }

  setFleet(names: readonly string[]): void {
    if (names.length === this.fleet.length && names.every((name, i) => name === this.fleet[i])) return;
    this.fleet = names;
    this.show(this.orders);
  }

  /** Something about an order that has no answers yet, or never will. */
  say(words: string): void {
    setText(this.summary, words);
  }

  show(orders: readonly Order[]): void {
    this.orders = orders;
    const newest = orders.at(-1);
    setAttribute(this.newest, 'data-order-id', newest ? String(newest.id) : null);
    setAttribute(this.newest, 'data-order-what', newest?.what ?? null);
    setAttribute(this.newest, 'data-state', newest ? orderState(newest) : null);
    setText(this.summary, newest ? orderSummary(newest) : 'No order given yet');
    const looks = identities(this.fleet);
    const answers = Object.entries(newest?.answers ?? {});
    answers.sort(([a], [b]) => this.fleet.indexOf(a) - this.fleet.indexOf(b));
    this.chips.replaceChildren(
      ...answers.map(([name, answer]) => {
        const look = looks.get(name);
        const words = answerWords(answer);
        return html(
          'li',
          { class: 'chip', 'data-vehicle': name, 'data-answer': answer.state, title: `${name}: ${words}` },
          ...(look ? [badge(look), html('span', { class: 'unseen' }, name)] : [name]),
          html('span', { class: 'chip-mark', 'aria-hidden': 'true' }, MARKS[answer.state]),
          html('span', { class: 'chip-words' }, words),
        );
      }),
    );
    const rest = orders.slice(0, -1).reverse();
    this.earlier.hidden = rest.length === 0;
    setText(this.earlierHead, `Earlier (${rest.length})`);
    this.earlierList.replaceChildren(
      ...rest.map((order) =>
        html('li', { 'data-state': orderState(order) }, html('time', {}, clockWords(order.time_s)), html('span', {}, orderSummary(order))),
      ),
    );
  }
}

function answerWords(answer: Answer): string {
  if (answer.state === 'acknowledged') return answer.after_ms === null ? 'acknowledged' : durationWords(answer.after_ms);
  if (answer.state === 'refused') return answer.why ? `refused: ${answer.why}` : 'refused';
  return answer.state;
}
