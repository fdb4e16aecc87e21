import assert from 'node:assert/strict';
import test from 'node:test';
import { TypedNumber } from '../src/typed-number';

function typed(fleet: number, ...keys: [digit: string, at: number][]): (number | null)[] {
  const number = new TypedNumber((wanted) => wanted >= 1 && wanted <= fleet);
  return keys.map(([digit, at]) => number.type(digit, at));
}

test('digits that follow one another soon are one number', () => {
  assert.deepEqual(typed(100, ['1', 0], ['0', 300], ['0', 600]), [1, 10, 100]);
  assert.deepEqual(typed(100, ['1', 0], ['2', 900]), [1, 2]);
});

test('a number that no vehicle has begins anew with its last digit', () => {
  assert.deepEqual(typed(9, ['1', 0], ['2', 100]), [1, 2]);
  assert.deepEqual(typed(12, ['1', 0], ['3', 100], ['1', 200]), [1, 3, 1]);
});

test('a digit that no vehicle has is no number, and nothing follows from it', () => {
  assert.deepEqual(typed(3, ['0', 0], ['1', 100], ['7', 200]), [null, 1, null]);
});
