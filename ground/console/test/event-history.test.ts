import assert from 'node:assert/strict';
import test from 'node:test';
import { EventHistory, passes, severityOf, split } from '../src/event-history';
import type { SwarmEvent } from '../src/protocol';

function event(seq: number, over: Partial<SwarmEvent> = {}): SwarmEvent {
  return {
    time_s: seq,
    home: 'uav/1',
    seq,
    name: 'uav/1/takeoff',
    data: {},
    requested_by: [],
    blocked_by: [],
    ...over,
  };
}

test('what a reconnection repeats is added once', () => {
  const history = new EventHistory();
  history.add([event(1), event(2)]);
  const fresh = history.add([event(1), event(2), event(3)]);
  assert.deepEqual(fresh.map(({ seq }) => seq), [3]);
  assert.equal(history.events.length, 3);
});

test('events differ by home, sequence, time and name', () => {
  const history = new EventHistory();
  const same = event(0);
  const others = [event(0, { home: 'uav/2' }), event(0, { time_s: 1 }), event(0, { name: 'uav/1/landed' })];
  assert.equal(history.add([same, same, ...others]).length, 4);
});

test('the oldest make room, and are forgotten', () => {
  const history = new EventHistory(3);
  history.add([event(1), event(2), event(3), event(4), event(5)]);
  assert.deepEqual(history.events.map(({ seq }) => seq), [3, 4, 5]);
  assert.equal(history.add([event(1)]).length, 1);
});

test('a filter by vehicle lets through what concerns it', () => {
  const only = { text: '', vehicles: new Set(['uav/1']) };
  assert.ok(passes(event(1), only));
  assert.ok(passes(event(1, { home: 'uav/2', name: 'uav/2/enter', blocked_by: ['uav/1#right_of_way'] }), only));
  assert.ok(!passes(event(1, { home: 'uav/10', name: 'uav/10/enter', requested_by: ['uav/12#x'] }), only));
});

test('a filter by text looks everywhere', () => {
  const planned = event(1, { data: { why: 'New waypoint' }, requested_by: ['uav/1#mission'] });
  for (const text of ['take', 'UAV/1', 'mission', 'new way', ' ']) assert.ok(passes(planned, { text, vehicles: null }), text);
  assert.ok(!passes(planned, { text: 'landed', vehicles: null }));
});

test("an event's name is its node and its verb", () => {
  assert.deepEqual(split('uav/1/takeoff'), { node: 'uav/1', verb: 'takeoff' });
  assert.deepEqual(split('odd'), { node: 'odd', verb: '' });
});

test('a line of an autopilot stands out by how serious it is', () => {
  const said = (severity: string) => severityOf(event(1, { name: 'uav/1/autopilot_says', data: { severity, text: 'x', times: 1 } }));
  assert.deepEqual(['emergency', 'alert', 'critical', 'error'].map(said), ['bad', 'bad', 'bad', 'bad']);
  assert.deepEqual(['warning', 'notice', 'info'].map(said), ['warn', null, null]);
  assert.equal(severityOf(event(1)), null);
});
