import assert from 'node:assert/strict';
import test from 'node:test';
import { Color } from 'three';
import { retryDelay } from '../src/connection';
import type { Vec3 } from '../src/protocol';
import { gridStep } from '../src/view/ground';
import { roundLength } from '../src/view/instruments';
import { dashes, type Strokes } from '../src/view/strokes';
import { TRAIL_S, Trails } from '../src/view/trails';

test('a trail keeps points that are apart, for a minute', () => {
  const trails = new Trails();
  trails.add('uav/1', [0, 0, 0]);
  trails.add('uav/1', [0.1, 0, 0]);
  trails.advance(10);
  trails.add('uav/1', [1, 0, 0]);
  assert.deepEqual(trails.of('uav/1').map(({ at }) => at[0]), [0, 1]);
  trails.advance(TRAIL_S + 1);
  assert.deepEqual(trails.of('uav/1').map(({ at }) => at[0]), [1]);
});

test('time that runs backwards begins a new run', () => {
  const trails = new Trails();
  trails.advance(100);
  trails.add('uav/1', [0, 0, 0]);
  trails.advance(0);
  assert.equal(trails.of('uav/1').length, 0);
});

test('dashes run on round a corner and never leave the path', () => {
  const drawn: number[] = [];
  const strokes = { line: (from: Vec3, to: Vec3) => drawn.push(from[0] + from[1], to[0] + to[1]) } as unknown as Strokes;
  dashes(strokes, [[0, 0, 0], [2.5, 0, 0], [2.5, 2.5, 0]], new Color(), 1);
  assert.deepEqual(drawn, [0, 1, 2, 2.5, 2.5, 3, 4, 5]);
});

test('grid and scale are round numbers of metres', () => {
  assert.deepEqual([20, 80, 81, 1000].map(gridStep), [1, 1, 2, 20]);
  assert.deepEqual([0.7, 1, 9.9, 49, 50].map(roundLength), [0.5, 1, 5, 20, 50]);
});

test('attempts to connect come ever later, up to five seconds', () => {
  assert.deepEqual([0, 1, 2, 3, 4, 50].map(retryDelay), [500, 1000, 2000, 4000, 5000, 5000]);
});
