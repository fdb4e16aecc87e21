import assert from 'node:assert/strict';
import { test } from 'node:test';
import { zoneTable } from '../src/drawing';
import { readMessage } from '../src/protocol';
import { endsOf } from '../src/view/zones';
import { zoneWords } from '../src/zones-panel';

const NOTHING = { radius: null, low: null, high: null };

test('one place and a radius are a circle, three places a polygon', () => {
  const circle = zoneTable('pond', 'no_fly', [[1, 2]], { ...NOTHING, radius: 5, high: 30 });
  assert.deepEqual(circle, { name: 'pond', kind: 'no_fly', centre_m: [1, 2], radius_m: 5, ceiling_m: 30 });
  const corners: [number, number][] = [[0, 0], [9, 0], [0, 9]];
  assert.deepEqual(zoneTable('yard', 'stay_inside', corners, NOTHING), { name: 'yard', kind: 'stay_inside', corners_m: corners });
});

test('a limit of height needs no place, and a rally point one', () => {
  assert.deepEqual(zoneTable('low', 'not_above', [], { ...NOTHING, high: 20 }), { name: 'low', kind: 'not_above', height_m: 20 });
  assert.deepEqual(zoneTable('barn', 'rally', [[3, 4]], { ...NOTHING, high: 6 }), { name: 'barn', kind: 'rally', centre_m: [3, 4], height_m: 6 });
});

test('what is still to be done is said', () => {
  assert.match(String(zoneTable('', 'no_fly', [], NOTHING)), /name/);
  assert.match(String(zoneTable('a', 'no_fly', [], NOTHING)), /corners/);
  assert.match(String(zoneTable('a', 'no_fly', [[0, 0]], NOTHING)), /radius/);
  assert.match(String(zoneTable('a', 'no_fly', [[0, 0], [1, 1]], NOTHING)), /third/);
  assert.match(String(zoneTable('a', 'threat', [[0, 0], [1, 1], [2, 0]], NOTHING)), /circle/);
  assert.match(String(zoneTable('a', 'not_below', [], NOTHING)), /height/);
});

test('zones are read with who keeps them, and one of an unknown kind is left out', () => {
  const answers = { 'uav/1': { state: 'acknowledged', after_ms: 12 }, 'uav/2': { state: 'refused', why: 'its disk does not take it' } };
  const zone = { name: 'pond', kind: 'no_fly', centre_m: [1, 2], radius_m: 5 };
  const records = [{ zone, by: 'Anna', time_s: 3, going: false, answers }, { zone: { name: 'x', kind: 'moat' } }];
  const message = readMessage(JSON.stringify({ type: 'zones', zones: records }));
  assert(message?.type === 'zones');
  assert.deepEqual(message.zones.map(({ zone }) => zone), [zone]);
  assert.equal(zoneWords(message.zones[0]!), 'no fly, kept by 1 of 2; uav/2 refused: its disk does not take it');
});

test('ends that a zone does not have are those of the view', () => {
  assert.deepEqual(endsOf({ name: 'a', kind: 'no_fly', floor_m: 3 }, 0, 20), [3, 20]);
  assert.deepEqual(endsOf({ name: 'a', kind: 'not_above', height_m: 8 }, 0, 20), [8, 20]);
  assert.deepEqual(endsOf({ name: 'a', kind: 'not_below', height_m: 8 }, 0, 20), [0, 8]);
});
