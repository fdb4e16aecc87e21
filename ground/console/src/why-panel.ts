/**
 * Why the selected vehicle does what it does: what keeps it where it is and what would end that, what is requested of it
 * and who blocks that, and what has happened at it last. The station reasons; this only shows it.
 */

import { html, setText } from './dom';
import type { Blocker, Change, Check, PastEvent, Requested, Vehicle, Why } from './protocol';
import { clockWords, durationWords, spaced } from './words';

export class WhyPanel {
  private readonly content = html('div', { class: 'reasons', tabindex: '0', role: 'region', 'aria-labelledby': 'why-title' });
  private vehicle: string | null = null;
  private checks: HTMLElement[] = [];
  private reasons: HTMLElement[] = [];
  /** What is shown, so that only what differs is laid out anew. */
  private shown = '';

  constructor(
    private readonly panel: HTMLElement,
    private readonly title: HTMLElement,
    private readonly note: HTMLElement,
    body: HTMLElement,
  ) {
    body.append(this.content);
  }

  /** Which vehicle is asked about, if any, of how many that are selected. */
  ask(vehicle: string | null, selected: number): void {
    this.panel.hidden = vehicle === null;
    this.panel.parentElement?.classList.toggle('asking', vehicle !== null);
    setText(this.note, selected > 1 ? `the first of ${selected} selected` : '');
    if (vehicle === this.vehicle) return;
    this.vehicle = vehicle;
    this.shown = '';
    [this.checks, this.reasons] = [[], []];
    setText(this.title, `Why ${vehicle ?? ''}`);
    this.content.replaceChildren(html('p', { class: 'reason-note' }, 'Asking the station…'));
    this.content.scrollTop = 0;
  }

  focus(): void {
    if (!this.panel.hidden) this.content.focus();
  }

  show(why: Why): void {
    if (why.vehicle !== this.vehicle) return;
    setText(this.title, titleWords(why));
    this.reasons = [
      ...section('Because', why.changes.map(changeItem)),
      ...section('Requested now', why.requests.map(requestItem)),
      ...section('Last events', why.events.map(eventItem)),
      ...section('Limits on its motion', why.limits.map((limit) => html('li', {}, limit))),
      ...why.doubts.map((doubt) => html('p', { class: 'reason-note' }, `Not sure: ${doubt}.`)),
    ];
    this.layOut();
  }

  /** The checks before take-off of the vehicle that is asked about; only on the ground are there any. */
  showChecks({ armed, checks }: Vehicle): void {
    this.checks = armed ? [] : section('Checks before take-off', [...checks].sort(byState).map(checkItem));
    if (this.reasons.length > 0 || this.checks.length > 0) this.layOut();
  }

  private layOut(): void {
    const parts = [...this.checks, ...this.reasons];
    const shown = parts.map((each) => each.outerHTML).join('');
    if (shown === this.shown) return;
    this.shown = shown;
    const { scrollTop } = this.content;
    this.content.replaceChildren(...parts);
    this.content.scrollTop = scrollTop;
  }
}

/** Those that do not pass come first. */
function byState(one: Check, other: Check): number {
  return Number(one.state === 'passes') - Number(other.state === 'passes');
}

function checkItem({ name, state, value, advice }: Check): HTMLElement {
  const mark = { passes: '✓', fails: '✕', waits: '…' }[state];
  const item = html('li', { class: 'reason', 'data-kind': state === 'passes' ? 'free' : 'blocked' });
  item.append(html('span', { class: 'check-mark', 'data-state': state }, `${mark} `), html('strong', {}, name), ` ${value}`);
  if (advice) item.append(html('p', { class: 'reason-blocked' }, `→ ${advice}`));
  return item;
}

/** `Why uav/3 stands still, for 12 s`. */
function titleWords({ vehicle, time_s, situation: { still_since_s: stillSince, speed_m_s: speed } }: Why): string {
  if (stillSince !== null) return `Why ${vehicle} stands still, for ${durationWords(Math.max(1000, (time_s - stillSince) * 1000))}`;
  return speed === null ? `Why ${vehicle}` : `Why ${vehicle} does what it does`;
}

function section(head: string, items: HTMLElement[]): HTMLElement[] {
  return items.length === 0 ? [] : [html('h3', { class: 'reason-head' }, head), html('ul', {}, ...items)];
}

function changeItem({ because, needed, cycle }: Change): HTMLElement {
  return html(
    'li',
    { class: 'reason', 'data-kind': cycle.length > 0 ? 'cycle' : 'change' },
    ...because.map((part, i) => html('p', {}, `${part}${i < because.length - 1 ? ';' : '.'}`)),
    ...(needed.length > 0
      ? [html('p', { class: 'reason-way' }, html('span', { class: 'reason-mark', 'aria-hidden': 'true' }, '→ '), `It moves on when ${needed.join(', or when ')}.`)]
      : []),
  );
}

function requestItem({ event, by, priority, blocked_by: blockedBy }: Requested): HTMLElement {
  const item = html('li', { class: 'reason', 'data-kind': blockedBy.length > 0 ? 'blocked' : 'free' });
  item.append(html('strong', {}, event), ` by ${spaced(by)}${priority === null ? '' : `, priority ${priority}`}`);
  for (const blocker of blockedBy) item.append(html('p', { class: 'reason-blocked' }, `✕ blocked by ${blockerWords(blocker)}`));
  return item;
}

function blockerWords({ node, bthread, local, lease_age_s: leaseAge, lease_s: lease }: Blocker): string {
  if (local) return `its own ${spaced(bthread)}`;
  const age = leaseAge === null ? '' : `, renewed ${durationWords(leaseAge * 1000)} ago`;
  return `${node}: ${spaced(bthread)}${age}${lease === null ? '' : `, lease ${durationWords(lease * 1000)}`}`;
}

function eventItem({ time_s, event, requested_by: requestedBy, choice }: PastEvent): HTMLElement {
  const asked = requestedBy.length > 0 ? `requested by ${requestedBy.map(spaced).join(', ')}` : 'a report';
  return html(
    'li',
    { class: 'reason' },
    html('time', {}, clockWords(time_s)),
    ' ',
    html('strong', {}, event),
    ` ${[asked, choice].filter(Boolean).join('; ')}`,
  );
}
