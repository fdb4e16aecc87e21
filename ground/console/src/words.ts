/**
 * What the swarm reports, in words for people.
 */

import type { Check, Command, Outcome } from './protocol';
import { What } from './vocabulary';

const ORDER_NAMES: Record<string, string> = {
  [What.goto]: 'Go to',
  [What.handBack]: 'Hand back',
  [What.load]: 'Script',
  [What.unload]: 'Withdraw',
};

/** An order's name as its button shows it: `goto` is `Go to`. */
export function orderName(what: Command | string): string {
  return ORDER_NAMES[what] ?? capitalised(spaced(what));
}

/**
 * Who keeps a vehicle waiting: `ground/main#hold` becomes `held by ground/main: hold`. A vehicle also uses this line to
 * complain of a fault in a sentence of its own, which stays as it is.
 */
export function waitingWords(waitingFor: string): string {
  const blockers = waitingFor.split(',').map((part) => part.trim()).filter(Boolean);
  if (!blockers.every(isBthread)) return waitingFor.trim();

  const byNode = new Map<string, string[]>();
  for (const blocker of blockers) {
    const hash = blocker.indexOf('#');
    const node = hash < 0 ? 'itself' : blocker.slice(0, hash);
    byNode.set(node, [...(byNode.get(node) ?? []), spaced(blocker.slice(hash + 1))]);
  }
  const holders = [...byNode].map(([node, bthreads]) => `${node}: ${bthreads.join(', ')}`);
  return holders.length === 0 ? '' : `held by ${holders.join('; ')}`;
}

/** What keeps a vehicle from being ready, by its checks: `position: no position yet; battery: no battery told`. */
export function faultWords(checks: readonly Check[]): string {
  return checks
    .filter(({ state }) => state !== 'passes')
    .map(({ name, value }) => `${name}: ${value}`)
    .join('; ');
}

/** `uav/2#right_of_way` (elsewhere) or `right_of_way` (its own). */
function isBthread(text: string): boolean {
  return /^[\w.-]+\/[\w.-]+#.+$/.test(text) || /^[a-z][a-z0-9_]*$/.test(text);
}

/** For how long, in the largest unit that fits: `40 ms`, `4 s`, `2 min 5 s`. */
export function durationWords(ms: number): string {
  if (ms < 1000) return `${Math.round(ms)} ms`;
  const seconds = Math.floor(ms / 1000);
  if (seconds < 60) return `${seconds} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ${seconds % 60} s`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/** Time since the run began, as a clock: `1:02.3`. */
export function clockWords(seconds: number): string {
  const tenths = Math.max(0, Math.floor(seconds * 10 + 1e-6));
  const hours = Math.floor(tenths / 36_000);
  const minutes = Math.floor(tenths / 600) % 60;
  const rest = `${String(Math.floor(tenths / 10) % 60).padStart(2, '0')}.${tenths % 10}`;
  return hours > 0 ? `${hours}:${String(minutes).padStart(2, '0')}:${rest}` : `${minutes}:${rest}`;
}

/** An event's data in one line, what and why first: `the path is blocked · leg 1 · at 1.0, 2.0, 3.0`. */
export function dataWords(data: Record<string, unknown>): string {
  const { what, why, severity, text, times, x, y, z, ...rest } = data;
  const often = typeof times === 'number' && times > 1 ? `${times} times` : undefined;
  const words = [severity, what, why, text, often].filter((value) => value !== undefined).map(valueWords);
  for (const [key, value] of Object.entries(rest)) words.push(key === 'leg' ? legWords(value) : `${spaced(key)} ${valueWords(value)}`);
  const place = [x, y, z].filter((coordinate) => typeof coordinate === 'number');
  if (place.length > 0) words.push(`at ${place.map((coordinate) => coordinate.toFixed(1)).join(', ')}`);
  return words.join(' · ');
}

/** Legs are counted from 1, as the tasks of vehicles count them; those that no mission leads to have words of their own. */
function legWords(leg: unknown): string {
  if (leg === -1) return 'way home';
  if (leg === -2) return "operator's point";
  return typeof leg === 'number' ? `leg ${leg + 1}` : `leg ${valueWords(leg)}`;
}

function valueWords(value: unknown): string {
  if (typeof value === 'string') return value;
  if (typeof value === 'number') return Number.isInteger(value) ? String(value) : value.toFixed(2);
  if (typeof value === 'boolean') return value ? 'yes' : 'no';
  return JSON.stringify(value) ?? '';
}

/** How the mission ended. `fleet` is how many vehicles there are. */
export function outcomeWords(outcome: Outcome, fleet: number): string {
  const failed = Object.entries(outcome.failed);
  const arrived = `${Math.max(0, fleet - failed.length)} of ${fleet} arrived`;
  if (outcome.succeeded && failed.length === 0) return `Mission complete: ${arrived}`;
  const reasons = failed.map(([name, why]) => (why ? `${name} (${why})` : name));
  const end = reasons.length > 0 ? `, failed: ${reasons.join(', ')}` : '';
  return `Mission ${outcome.succeeded ? 'complete' : 'failed'}: ${arrived}${end}`;
}

/** What the end of the connection means once the mission is over: nothing is wrong, and this is how it ended. */
export function overWords(outcome: Outcome, fleet: number, recording: string): string {
  const again = recording ? ` It is recorded in ${recording}.` : '';
  return `${outcomeWords(outcome, fleet)}. The station has ended; you see how it left the swarm.${again}`;
}

/** Names in a row, or their number when there are too many to read. */
export function nameWords(names: string[], most = 4): string {
  return names.length <= most ? names.join(', ') : `${names.slice(0, most - 1).join(', ')} and ${names.length - most + 1} more`;
}

/** `right_of_way` is `right of way`. */
export function spaced(identifier: string): string {
  return identifier.replaceAll('_', ' ');
}

function capitalised(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
