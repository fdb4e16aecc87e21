/**
 * What happened in the swarm, newest last. It follows the newest until the operator scrolls up.
 */

import { badge } from './badge';
import { html, setText } from './dom';
import { EventHistory, passes, severityOf, split } from './event-history';
import { type Identity, identities } from './identity';
import type { SwarmEvent } from './protocol';
import type { Selection } from './selection';
import { clockWords, dataWords, spaced } from './words';

/** This near to the end counts as being at it. */
const END_PX = 12;

export class EventsPanel {
  private readonly history = new EventHistory();
  private readonly list = html('ol', { class: 'feed', role: 'log', 'aria-live': 'off', 'aria-label': 'Events', tabindex: '0' });
  private readonly empty = html('p', { class: 'empty' }, 'Nothing has happened yet.');
  private readonly text = html('input', {
    type: 'search',
    placeholder: 'Filter',
    'aria-label': 'Filter events by text',
    autocomplete: 'off',
    spellcheck: 'false',
  });
  private readonly selectedOnly = html('input', { type: 'checkbox' });
  private readonly latest = html('button', { type: 'button', class: 'latest', hidden: true });
  private looks: ReadonlyMap<string, Identity> = new Map();
  private following = true;
  /** Where the feed was scrolled to last: only going up from there is the operator's doing. */
  private top = 0;
  private unseen = 0;
  /** Events heard since the last frame: a burst is laid out once. */
  private waiting: SwarmEvent[] = [];

  constructor(
    head: HTMLElement,
    body: HTMLElement,
    private readonly selection: Selection,
  ) {
    head.append(html('label', { class: 'check' }, this.selectedOnly, 'selected only'), this.text);
    body.append(this.list, this.empty, this.latest);
    this.text.addEventListener('input', () => this.showAll());
    this.selectedOnly.addEventListener('change', () => this.showAll());
    this.list.addEventListener('scroll', () => this.scrolled());
    this.latest.addEventListener('click', () => this.follow());
    new ResizeObserver(() => this.following && this.toEnd()).observe(this.list);
  }

  setFleet(names: readonly string[]): void {
    if (names.length === this.looks.size && names.every((name) => this.looks.has(name))) return;
    this.looks = identities(names);
    this.showAll();
  }

  /** `anew`: all that was heard before is void. */
  add(events: readonly SwarmEvent[], anew = false): void {
    if (anew) {
      this.history.clear();
      this.waiting = [];
      this.showAll();
    }
    const fresh = this.history.add(events);
    if (fresh.length === 0) return;
    if (this.waiting.length === 0) window.setTimeout(() => this.showFresh(), 50);
    this.waiting.push(...fresh);
  }

  showSelection(): void {
    if (this.selectedOnly.checked) this.showAll();
  }

  private get filter() {
    const { names } = this.selection;
    return { text: this.text.value, vehicles: this.selectedOnly.checked && names.size > 0 ? names : null };
  }

  private showFresh(): void {
    const { filter } = this;
    const shown = this.waiting.filter((event) => passes(event, filter)).map((event) => this.row(event));
    this.waiting = [];
    this.list.append(...shown);
    this.trim();
    if (this.following) this.toEnd();
    else this.unseen += shown.length;
    this.showState();
  }

  private showAll(): void {
    const { filter } = this;
    this.waiting = [];
    this.list.replaceChildren(...this.history.events.filter((event) => passes(event, filter)).map((event) => this.row(event)));
    this.follow();
  }

  /** Rows of events that the history has dropped go too. Where the operator reads, what they read stays put. */
  private trim(): void {
    const before = this.list.scrollHeight;
    const excess = this.list.childElementCount - this.history.events.length;
    for (let i = 0; i < excess; i += 1) this.list.firstElementChild?.remove();
    if (excess > 0 && !this.following) {
      this.list.scrollTop -= before - this.list.scrollHeight;
      this.top = this.list.scrollTop;
    }
  }

  private scrolled(): void {
    const atEnd = this.list.scrollHeight - this.list.scrollTop - this.list.clientHeight <= END_PX;
    if (atEnd) {
      this.following = true;
      this.unseen = 0;
    } else if (this.list.scrollTop < this.top - 1) {
      this.following = false;
    }
    this.top = this.list.scrollTop;
    this.showState();
  }

  private follow(): void {
    this.following = true;
    this.unseen = 0;
    this.toEnd();
    this.showState();
  }

  private toEnd(): void {
    this.list.scrollTop = this.list.scrollHeight;
    this.top = this.list.scrollTop;
  }

  private showState(): void {
    this.latest.hidden = this.following;
    setText(this.latest, this.unseen > 0 ? `↓ ${this.unseen} newer` : '↓ To the newest');
    this.empty.hidden = this.list.childElementCount > 0;
    setText(this.empty, this.history.events.length === 0 ? 'Nothing has happened yet.' : 'No event passes the filter.');
  }

  private row(event: SwarmEvent): HTMLLIElement {
    const { node, verb } = split(event.name);
    const look = this.looks.get(node);
    const data = dataWords(event.data);
    const who = html('span', { class: 'event-who', title: node }, ...(look ? [badge(look), html('span', { class: 'unseen' }, node)] : [node]));
    const row = html(
      'li',
      { class: 'event', title: `${event.name}, decided on ${event.home || node}${event.seq > 0 ? `, number ${event.seq}` : ', not shared'}` },
      html('time', { class: 'event-time' }, clockWords(event.time_s)),
      who,
      html('span', { class: 'event-verb' }, spaced(verb || event.name)),
      html('span', { class: 'event-data' }, data),
    );
    const severity = severityOf(event);
    if (severity) row.dataset.severity = severity;
    const asked = event.requested_by.map((bthread) => shortName(bthread, node));
    if (asked.length > 0) row.append(html('span', { class: 'event-by' }, `by ${asked.join(', ')}`));
    const blocked = event.blocked_by.map((bthread) => shortName(bthread, node));
    if (blocked.length > 0) row.append(html('span', { class: 'event-blocked' }, `blocked by ${blocked.join(', ')}`));
    return row;
  }
}

/** A b-thread of the event's own node needs no node before its name. */
function shortName(bthread: string, node: string): string {
  const [home, name] = bthread.split('#', 2);
  return spaced(name === undefined ? bthread : home === node ? name : `${home}: ${name}`);
}
