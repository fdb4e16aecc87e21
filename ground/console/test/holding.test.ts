import assert from 'node:assert/strict';
import test from 'node:test';
import { holdingNews, holdings } from '../src/holding';
import { readMessage, type Vehicle } from '../src/protocol';

function vehicle(name: string, holder: string, asked_by = ''): Vehicle {
  const message = readMessage(JSON.stringify({ type: 'fleet', vehicles: [{ name, holder, asked_by, heard: true }] }));
  assert.ok(message?.type === 'fleet' && message.vehicles[0]);
  return message.vehicles[0];
}

test('each holder is named once, with their vehicles and who asks for them', () => {
  const fleet = [vehicle('uav/1', 'Anna', 'Ben'), vehicle('uav/2', ''), vehicle('uav/3', 'Anna', 'Ben')];
  assert.deepEqual(holdings(fleet), [
    { holder: 'Anna', vehicles: ['uav/1', 'uav/3'], askers: ['Ben'] },
    { holder: '', vehicles: ['uav/2'], askers: [] },
  ]);
});

test('one notices when a vehicle is taken, asked for, given or lost, and nothing else', () => {
  const news = (before: Vehicle, now: Vehicle) => holdingNews(before, now, 'Anna');
  const mine = vehicle('uav/1', 'Anna');
  assert.equal(news(mine, vehicle('uav/1', 'Ben')), 'Ben commands uav/1 now.');
  assert.equal(news(mine, vehicle('uav/1', '')), 'You command uav/1 no more.');
  assert.equal(news(mine, vehicle('uav/1', 'Anna', 'Ben')), 'Ben asks for uav/1.');
  assert.equal(news(vehicle('uav/1', 'Ben'), mine), 'You command uav/1 now.');
  assert.equal(news(vehicle('uav/1', ''), mine), null, 'the first order took it');
  assert.equal(news(mine, mine), null);
  assert.equal(news(vehicle('uav/1', 'Ben'), vehicle('uav/1', 'Carl')), null);
  assert.equal(holdingNews(undefined, mine, 'Anna'), null);
  assert.equal(holdingNews(mine, vehicle('uav/1', 'Ben'), null), null);
});

test('an offer without a token, or of another order, is none', () => {
  const offer = (fields: object) => readMessage(JSON.stringify({ type: 'offer', token: 't', what: 'launch', vehicles: [{ name: 'uav/1', doubts: ['x', 3] }], ...fields }));
  const read = offer({ lasts_s: 10 });
  assert.ok(read?.type === 'offer');
  assert.deepEqual(read.vehicles, [{ name: 'uav/1', task: '', doubts: ['x'] }]);
  assert.equal(offer({ token: '' }), null);
  assert.equal(offer({ what: 'hold' }), null);
});

test('whoever has no known role only sees', () => {
  const you = (role: string) => readMessage(JSON.stringify({ type: 'you', name: 'Anna', role, certified: true }));
  const roles = ['operator', 'safety', 'king', ''].map(you).map((read) => read?.type === 'you' && read.role);
  assert.deepEqual(roles, ['operator', 'safety', 'observer', 'observer']);
});
