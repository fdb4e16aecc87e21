import assert from 'node:assert/strict';
import test from 'node:test';
import { orderState, orderSummary } from '../src/order-summary';
import type { Answer } from '../src/protocol';

const acknowledged: Answer = { state: 'acknowledged', after_ms: 12 };

function order(answers: Record<string, Answer>) {
  return { id: 1, by: 'Anna', what: 'hold', script: '', time_s: 0, answers };
}

test('who is missing is named', () => {
  const half = order({ 'uav/1': acknowledged, 'uav/2': acknowledged, 'uav/3': { state: 'missing' } });
  assert.equal(orderSummary(half), 'Hold by Anna: 2 of 3 acknowledged, uav/3 missing');
  assert.equal(orderState(half), 'missing');
});

test('who has yet to answer is counted', () => {
  const early = order({ 'uav/1': acknowledged, 'uav/2': { state: 'pending' }, 'uav/3': { state: 'pending' } });
  assert.equal(orderSummary(early), 'Hold by Anna: 1 of 3 acknowledged, 2 pending');
  assert.equal(orderState(early), 'pending');
});

test('a refusal weighs most', () => {
  const refused = order({ 'uav/1': { state: 'refused', why: 'on the ground' }, 'uav/2': { state: 'missing' } });
  assert.equal(orderSummary(refused), 'Hold by Anna: 0 of 2 acknowledged, uav/1 refused, uav/2 missing');
  assert.equal(orderState(refused), 'refused');
});

test('an order that all acknowledged is done', () => {
  assert.equal(orderSummary(order({ 'uav/1': acknowledged })), 'Hold by Anna: 1 of 1 acknowledged');
  assert.equal(orderState(order({ 'uav/1': acknowledged })), 'acknowledged');
});
