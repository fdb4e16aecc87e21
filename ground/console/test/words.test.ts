import assert from 'node:assert/strict';
import test from 'node:test';
import { clockWords, dataWords, durationWords, faultWords, nameWords, orderName, outcomeWords, overWords, waitingWords } from '../src/words';

test('a b-thread elsewhere that blocks is named with its node', () => {
  assert.equal(waitingWords('ground/main#hold'), 'held by ground/main: hold');
  assert.equal(waitingWords('uav/2#right_of_way'), 'held by uav/2: right of way');
});

test("a vehicle's own b-thread is told from those of others", () => {
  assert.equal(waitingWords('preflight'), 'held by itself: preflight');
  assert.equal(
    waitingWords('ground/main#hold, ground/main#muster, preflight'),
    'held by ground/main: hold, muster; itself: preflight',
  );
});

test('a complaint in a sentence stays as it is', () => {
  const complaint = 'COM_OF_LOSS_T, needed for offboard, cannot be read';
  assert.equal(waitingWords(complaint), complaint);
  assert.equal(waitingWords(''), '');
});

test('checks that do not pass are named with what was found', () => {
  const check = (name: string, state: 'passes' | 'fails' | 'waits', value: string) => ({ name, state, value, advice: '' });
  const checks = [check('autopilot', 'passes', 'PX4'), check('position', 'waits', 'no position yet'), check('battery', 'fails', '12 %')];
  assert.equal(faultWords(checks), 'position: no position yet; battery: 12 %');
});

test('durations come in the largest unit that fits', () => {
  assert.deepEqual([40.4, 4999, 125_000, 3_720_000].map(durationWords), ['40 ms', '4 s', '2 min 5 s', '1 h 2 min']);
});

test('the clock carries tenths into seconds and seconds into minutes', () => {
  assert.deepEqual([0, 12.34, 59.99, 62.3, 3661].map(clockWords), ['0:00.0', '0:12.3', '0:59.9', '1:02.3', '1:01:01.0']);
});

test('the reason comes first among the data, the place last', () => {
  assert.equal(dataWords({ leg: 1, x: 1, y: 2.04, z: 3, why: 'new waypoint' }), 'new waypoint · leg 2 · at 1.0, 2.0, 3.0');
  assert.equal(dataWords({ length_m: 12.345, lands: true, odd: null }), 'length m 12.35 · lands yes · odd null');
  assert.equal(dataWords({ what: 'hold' }), 'hold');
  assert.equal(dataWords({}), '');
});

test('the outcome counts arrivals and gives reasons', () => {
  assert.equal(outcomeWords({ succeeded: true, failed: {} }, 8), 'Mission complete: 8 of 8 arrived');
  assert.equal(
    outcomeWords({ succeeded: false, failed: { 'uav/1': 'no path', 'uav/2': '' } }, 8),
    'Mission failed: 6 of 8 arrived, failed: uav/1 (no path), uav/2',
  );
});

test('long rows of names are cut', () => {
  assert.equal(nameWords(['a', 'b']), 'a, b');
  assert.equal(nameWords(['a', 'b', 'c', 'd', 'e', 'f']), 'a, b, c and 3 more');
});

test('orders are named as on their buttons', () => {
  assert.deepEqual(['hold', 'goto', 'hand_back'].map(orderName), ['Hold', 'Go to', 'Hand back']);
});

test('ways that no mission leads along have words and no number', () => {
  assert.equal(dataWords({ leg: -1 }), 'way home');
  assert.equal(dataWords({ leg: -2, x: 1, y: 2, z: 3 }), "operator's point · at 1.0, 2.0, 3.0");
});

test('after the end of a mission nothing is said to be lost, and where its recording is', () => {
  const words = overWords({ succeeded: true, failed: {} }, 3, 'out/forest-1/mission.mcap');
  assert.equal(words, 'Mission complete: 3 of 3 arrived. The station has ended; you see how it left the swarm. It is recorded in out/forest-1/mission.mcap.');
  assert.ok(!overWords({ succeeded: false, failed: { 'uav/1': 'battery low' } }, 3, '').includes('recorded'));
});
