/**
 * The events heard so far: each once, the latest few hundred.
 */

import type { SwarmEvent } from './protocol';

export const MOST_EVENTS = 500;

export interface EventFilter {
  /** What the operator typed; matches anywhere. */
  text: string;
  /** Only events that concern one of these vehicles; `null` for all. */
  vehicles: ReadonlySet<string> | null;
}

export class EventHistory {
  readonly events: SwarmEvent[] = [];
  private readonly known = new Set<string>();

  constructor(private readonly most = MOST_EVENTS) {}

  /** All that was heard is void. */
  clear(): void {
    this.events.length = 0;
    this.known.clear();
  }

  /** Adds what is not known yet (a station repeats its recent history on each connection), and returns just that. */
  add(events: readonly SwarmEvent[]): SwarmEvent[] {
    const fresh: SwarmEvent[] = [];
    for (const event of events) {
      const key = keyOf(event);
      if (this.known.has(key)) continue;
      this.known.add(key);
      fresh.push(event);
    }
    this.events.push(...fresh);
    for (const event of this.events.splice(0, Math.max(0, this.events.length - this.most))) {
      this.known.delete(keyOf(event));
    }
    return fresh.slice(-this.most);
  }
}

function keyOf(event: SwarmEvent): string {
  return `${event.home} ${event.seq} ${event.time_s} ${event.name}`;
}

export function passes(event: SwarmEvent, filter: EventFilter): boolean {
  if (filter.vehicles && ![...filter.vehicles].some((vehicle) => concerns(event, vehicle))) return false;
  const text = filter.text.trim().toLowerCase();
  if (!text) return true;
  const words = [event.name, event.home, ...event.requested_by, ...event.blocked_by, JSON.stringify(event.data)];
  return words.some((word) => word.toLowerCase().includes(text));
}

/** Whether a vehicle decided the event, is named by it, asked for it or stood in its way. */
function concerns(event: SwarmEvent, vehicle: string): boolean {
  return (
    event.home === vehicle ||
    event.name.startsWith(`${vehicle}/`) ||
    [...event.requested_by, ...event.blocked_by].some((bthread) => bthread.startsWith(`${vehicle}#`))
  );
}

/** How serious a line of an autopilot is: trouble, or something to be careful of. */
export function severityOf(event: SwarmEvent): 'bad' | 'warn' | null {
  switch (event.data.severity) {
    case 'emergency':
    case 'alert':
    case 'critical':
    case 'error':
      return 'bad';
    case 'warning':
      return 'warn';
    default:
      return null;
  }
}

/** An event's vehicle (or station) and verb: `uav/1/takeoff` is `uav/1` and `takeoff`. */
export function split(name: string): { node: string; verb: string } {
  const chunks = name.split('/');
  return { node: chunks.slice(0, 2).join('/'), verb: chunks.slice(2).join('/') };
}
