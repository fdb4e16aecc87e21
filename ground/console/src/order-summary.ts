/**
 * What has become of an order, in one line: `Hold by Anna: 7 of 8 acknowledged, uav/3 missing`.
 */

import type { Answer, Order } from './protocol';
import { nameWords, orderName } from './words';

export function orderSummary(order: Order): string {
  const answers = Object.entries(order.answers);
  const named = (state: Answer['state']) => answers.filter(([, answer]) => answer.state === state).map(([name]) => name);
  const acknowledged = named('acknowledged').length;
  const pending = named('pending').length;

  const parts = [`${acknowledged} of ${answers.length} acknowledged`];
  for (const state of ['refused', 'missing'] as const) {
    const names = named(state);
    if (names.length > 0) parts.push(`${nameWords(names)} ${state}`);
  }
  if (pending > 0) parts.push(`${pending} pending`);
  const what = [orderName(order.what), order.script].filter(Boolean).join(' ');
  return `${what}${order.by && ` by ${order.by}`}: ${parts.join(', ')}`;
}

/** How an order stands as a whole: the worst of its answers. */
export function orderState(order: Order): Answer['state'] {
  const states = new Set(Object.values(order.answers).map((answer) => answer.state));
  return (['refused', 'missing', 'pending'] as const).find((state) => states.has(state)) ?? 'acknowledged';
}
