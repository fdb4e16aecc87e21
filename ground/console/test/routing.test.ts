import assert from 'node:assert/strict';
import { test } from 'node:test';
import { readMessage } from '../src/protocol';
import { secondsWords, summaryWords } from '../src/rehearsal-dialog';
import { routeWords } from '../src/routing';

test('a route is told by its points, its length and its heights', () => {
  assert.equal(routeWords([]), 'Click its points on the ground');
  assert.equal(routeWords([[0, 0, 5]]), '1 point, 5.0 m high');
  assert.equal(routeWords([[0, 0, 5], [3, 4, 5], [3, 4, 8]]), '3 points, 8 m, 5.0 to 8.0 m high');
});

test('a rehearsal is read with what it lacks, and told', () => {
  const said = {
    type: 'rehearsed',
    tag: 'a',
    rehearsed: {
      seeds: [1, 2, 3],
      succeeded: false,
      vehicles: [
        { vehicle: 'uav/1', arrives: 2, lands_s: { least: 20, mean: 21, most: 22 }, battery: null, waits: [{ waits_for: 'uav/2', mean_s: 2 }], fails: [{ why: 'battery low', seeds: 1 }] },
        { vehicle: 'uav/2' },
      ],
      nearest: [{ who: ['uav/1', 'uav/2'], distance_m: 1.84, at_s: 12.3, seed: 2 }, { who: ['uav/1'] }],
      clearance_m: 0.71,
      collisions: [1, 0],
    },
    left_out: { 'uav/3': 'is silent' },
  };
  const rehearsal = readMessage(JSON.stringify(said));
  assert.ok(rehearsal?.type === 'rehearsed');
  assert.equal(rehearsal.flights, 3);
  assert.deepEqual(rehearsal.vehicles[1], { vehicle: 'uav/2', arrives: 0, lands_s: null, battery: null, waits: [], fails: [] });
  assert.equal(rehearsal.nearest.length, 1);
  assert.deepEqual(rehearsal.left_out, { 'uav/3': 'is silent' });
  assert.equal(secondsWords(rehearsal.vehicles[0]!.lands_s), '20 to 22 s');
  assert.equal(secondsWords(null), '–');
  assert.equal(summaryWords(rehearsal), 'Nearest: uav/1 and uav/2, 1.8 m after 12 s; an obstacle 0.7 m from a hull; 1 collisions with obstacles, 0 between vehicles.');
});
