import assert from 'node:assert/strict';
import test from 'node:test';
import { argument, argumentText } from '../src/argument';

test('what is typed becomes a value of its kind, or none', () => {
  assert.equal(argument('number', ' 2.5 '), 2.5);
  assert.equal(argument('integer', '3'), 3);
  assert.equal(argument('node', 'uav/2'), 'uav/2');
  assert.deepEqual(argument('point', '1, -2.5  3'), [1, -2.5, 3]);
  assert.deepEqual(argument('route', '1 2 3\n\n4,5,6\n'), [[1, 2, 3], [4, 5, 6]]);
  for (const [kind, text] of [
    ['number', ''], ['number', 'x'], ['number', '1e999'], ['integer', '2.5'], ['node', 'uav'], ['point', '1, 2'], ['point', '1, 2, x'],
    ['route', ''], ['route', '1 2 3\n4 5'],
  ] as const) {
    assert.equal(argument(kind, text), null, `${kind} ${text}`);
  }
});

test('a value is typed as it is read', () => {
  for (const [kind, value] of [['number', 2.5], ['node', 'uav/2'], ['point', [1, 2, 3]], ['route', [[1, 2, 3], [4, 5, 6]]]] as const) {
    assert.deepEqual(argument(kind, argumentText(value as never)), value);
  }
});
