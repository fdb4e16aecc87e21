// A zone is drawn by clicks across everyone's way: all confirm it, fly round it, and it is removed.
//
//     node zone.mjs URL      beside `skein-sim fly open --headless`

import assert from 'node:assert/strict';
import { apart, drive, NAME, speed } from './browser.mjs';

const MIDDLE = [0, 0];
const RADIUS_M = 2.5;

await drive({}, async (console) => {
  await console.until('somebody flies', () => console.fleet?.vehicles.some((vehicle) => vehicle.armed && speed(vehicle) > 0.5));
  await console.press('Draw a zone…');
  await console.page.getByLabel('Name of the zone').fill('pond');
  await console.page.getByLabel('Radius of the circle, in metres').fill(String(RADIUS_M));
  await console.clickAt(...MIDDLE);
  await console.press('Draw');
  const line = console.page.locator('[data-zone="pond"]');
  await console.until('all keep it', async () => (await line.count()) === 1 && /kept by 4 of 4/.test(await line.textContent()));
  const [{ zone, by }] = console.zones;
  assert.equal(by, NAME);
  assert.equal(zone.kind, 'no_fly');
  assert.ok(apart(zone.centre_m, MIDDLE) < 0.5, `drawn at ${zone.centre_m}`);
  const regarded = () => console.fleet.vehicles.every(({ zones }) => zones.includes('pond'));
  await console.until('each vehicle says so itself', regarded);
  const { time_s } = console.fleet;

  const passed = ({ name, position }) => console.history(name)[0].position.some((then, axis) => axis < 2 && Math.abs(position[axis] - then) > 14);
  await console.until('all have passed', () => console.fleet.vehicles.every(passed), 60);
  for (const { name } of console.fleet.vehicles) {
    const nearest = Math.min(...console.history(name, time_s).map(({ position }) => apart(position, zone.centre_m)));
    assert.ok(nearest > RADIUS_M, `${name} was ${nearest} m from the middle`);
  }

  await line.getByRole('button', { name: 'Remove' }).click();
  await console.until('it is gone', async () => console.zones.length === 0 && (await line.count()) === 0);
  await console.until('no vehicle has regard for it', () => console.fleet.vehicles.every(({ zones }) => zones.length === 0));
  await console.stay();
});
