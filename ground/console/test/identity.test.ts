import assert from 'node:assert/strict';
import test from 'node:test';
import { identities } from '../src/identity';
import { addresseeWords, Selection } from '../src/selection';

test('a vehicle has the number in its name', () => {
  assert.deepEqual([...identities(['uav/3', 'uav/7']).values()].map(({ number }) => number), [3, 7]);
});

test('where numbers clash or are missing, the place in the list counts', () => {
  for (const names of [['a/1', 'b/1'], ['left', 'right']]) {
    assert.deepEqual([...identities(names).values()].map(({ number }) => number), [1, 2]);
  }
});

test('forty vehicles look different', () => {
  const names = Array.from({ length: 40 }, (_, i) => `uav/${i + 1}`);
  const looks = [...identities(names).values()].map(({ colour, shape }) => `${colour} ${shape}`);
  assert.equal(new Set(looks).size, 40);
});

test('with none or all selected an order is for all', () => {
  const fleet = ['uav/1', 'uav/2', 'uav/3'];
  const selection = new Selection(() => {});
  assert.equal(selection.addressees(fleet), 'all');
  selection.pick('uav/3');
  selection.toggle('uav/1');
  assert.deepEqual(selection.addressees(fleet), ['uav/1', 'uav/3']);
  assert.equal(addresseeWords(selection.addressees(fleet), 3), 'uav/1, uav/3');
  selection.set(fleet);
  assert.equal(addresseeWords(selection.addressees(fleet), 3), 'All 3 vehicles');
});

test('a selected vehicle that left the fleet does not turn its order into one for all', () => {
  const selection = new Selection(() => {});
  selection.pick('uav/9');
  assert.deepEqual(selection.addressees(['uav/1', 'uav/2']), ['uav/9']);
});
