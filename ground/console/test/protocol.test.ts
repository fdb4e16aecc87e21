import assert from 'node:assert/strict';
import test from 'node:test';
import { readMessage } from '../src/protocol';

const read = (json: unknown) => readMessage(JSON.stringify(json));

test('what is no message is refused without a fuss', () => {
  for (const text of ['', '{', '[]', 'null', '3', '{"type":"weather"}', '{}']) assert.equal(readMessage(text), null, text);
});

test('a scene keeps the obstacles it can read', () => {
  const cylinder = { form: 'cylinder', radius: 1, height: 4, position: [1, 2, 3] };
  const scene = read({ type: 'scene', obstacles: [cylinder, null, { form: 'cone' }, { form: 'box', position: [0, 0, 0] }] });
  assert.ok(scene?.type === 'scene');
  assert.equal(scene.bounds, null);
  assert.deepEqual(scene.obstacles, [{ ...cylinder, orientation: [0, 0, 0, 1] }]);
});

test('a vehicle never heard of has nulls and throws nothing', () => {
  const fleet = read({
    type: 'fleet',
    vehicles: [{ name: 'uav/1', heard: false, position: null, mode: null, link: { alive: false, age_ms: null }, notes: null }],
  });
  assert.ok(fleet?.type === 'fleet');
  const vehicle = fleet.vehicles[0];
  assert.ok(vehicle);
  assert.equal(vehicle.heard, false);
  assert.equal(vehicle.position, null);
  assert.deepEqual(vehicle.link, { alive: false, age_ms: null });
  assert.deepEqual(vehicle.notes, []);
});

test('a check of a state that is not known does not pass, and one without a name is dropped', () => {
  const fleet = read({
    type: 'fleet',
    vehicles: [{ name: 'uav/1', checks: [{ name: 'home', state: 'fails', value: 'far', advice: 'carry it' }, { name: 'x', state: 'odd' }, {}] }],
  });
  assert.ok(fleet?.type === 'fleet');
  assert.deepEqual(fleet.vehicles[0]?.checks, [
    { name: 'home', state: 'fails', value: 'far', advice: 'carry it' },
    { name: 'x', state: 'waits', value: '', advice: '' },
  ]);
});

test('positions that are no positions are dropped', () => {
  const fleet = read({
    type: 'fleet',
    vehicles: [{ name: 'uav/1', heard: true, position: [1, 2], path: [[1, 2, 3], 'x', [1, null, 3]], battery: 'full' }, { heard: true }],
  });
  assert.ok(fleet?.type === 'fleet');
  assert.equal(fleet.vehicles.length, 1);
  assert.equal(fleet.vehicles[0]?.position, null);
  assert.equal(fleet.vehicles[0]?.battery, null);
  assert.deepEqual(fleet.vehicles[0]?.path, [[1, 2, 3]]);
});

test('an answer of an unknown kind is still pending', () => {
  const orders = read({
    type: 'orders',
    orders: [{ id: 1, what: 'hold', answers: { a: { state: 'acknowledged', after_ms: 3 }, b: { state: 'refused', why: 'no' }, c: 7 } }],
  });
  assert.ok(orders?.type === 'orders');
  assert.deepEqual(orders.orders[0]?.answers, {
    a: { state: 'acknowledged', after_ms: 3 },
    b: { state: 'refused', why: 'no' },
    c: { state: 'pending' },
  });
});

test('an outcome says who failed and why', () => {
  const fleet = read({ type: 'fleet', time_s: 3, outcome: { succeeded: false, failed: { 'uav/1': 'no path' } } });
  assert.ok(fleet?.type === 'fleet');
  assert.deepEqual(fleet.outcome, { succeeded: false, failed: { 'uav/1': 'no path' } });
});

test('a refusal without words still says something', () => {
  const refusal = read({ type: 'error', tag: 4 });
  assert.ok(refusal?.type === 'error');
  assert.equal(refusal.tag, null);
  assert.match(refusal.message, /refused/);
});

test('an explanation keeps what it can read, and one of a vehicle never heard has neither place nor speed', () => {
  const why = read({
    type: 'why',
    vehicle: 'uav/3',
    situation: null,
    requests: [{ event: 'uav/3/advance', by: 'navigation', priority: 10, blocked_by: [{ node: 'ground/main', bthread: 'hold', local: false, lease_age_s: 0.2 }, 3] }, { by: 'nobody' }],
    changes: [{ because: ['so', 7], needed: null }],
    events: [{ time_s: 2, event: 'uav/3/takeoff', requested_by: ['ground/main#launch'], choice: null }],
  });
  assert.ok(why?.type === 'why');
  assert.deepEqual(why.situation, { speed_m_s: null, still_since_s: null });
  const blocked_by = [{ node: 'ground/main', bthread: 'hold', local: false, lease_age_s: 0.2, lease_s: null }];
  assert.deepEqual(why.requests, [{ event: 'uav/3/advance', by: 'navigation', priority: 10, blocked_by }]);
  assert.deepEqual(why.changes, [{ because: ['so'], needed: [], cycle: [] }]);
  assert.deepEqual(why.events, [{ time_s: 2, event: 'uav/3/takeoff', home: '', requested_by: ['ground/main#launch'], choice: null }]);
});
