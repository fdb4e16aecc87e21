import assert from 'node:assert/strict';
import { test } from 'node:test';
import { EventHistory } from '../src/event-history';
import { readMessage } from '../src/protocol';

test('where a recording is, is read, and what is missing has a sound value', () => {
  const said = { type: 'replay', at_s: 3, from_s: 1, to_s: 9, playing: true, speed: 2, complete: false };
  assert.deepEqual(readMessage(JSON.stringify(said)), said);
  assert.deepEqual(readMessage('{"type":"replay","from_s":1}'), { type: 'replay', at_s: 1, from_s: 1, to_s: 0, playing: false, speed: 1, complete: false });
});

test('after time has jumped the same events are new again', () => {
  const event = { time_s: 1, home: 'uav/1', seq: 4, name: 'uav/1/land', data: {}, requested_by: [], blocked_by: [] };
  const history = new EventHistory();
  assert.equal(history.add([event]).length, 1);
  assert.equal(history.add([event]).length, 0);
  history.clear();
  assert.equal(history.add([event]).length, 1);
});
