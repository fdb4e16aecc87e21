// A route is drawn by clicks for one vehicle, rehearsed, sent, read back, and changed while it is flown.
//
//     node route.mjs URL [FOLDER]      beside `skein-sim fly two-lanes.toml --headless`; pictures go into FOLDER

import assert from 'node:assert/strict';
import { apart, drive, speed } from './browser.mjs';

const WHO = 'uav/1';
const folder = process.argv[3];

await drive({ ...(process.env.SKEIN_COLOURS && { colorScheme: process.env.SKEIN_COLOURS }) }, async (console) => {
  const picture = (name) => folder && console.page.screenshot({ path: `${folder}/${name}.png` });
  await console.until('it flies', () => console.vehicle(WHO)?.armed && speed(console.vehicle(WHO)) > 0.5);
  await console.select(WHO);
  const before = console.vehicle(WHO).way;
  assert.ok(before.length > 0, 'it has told what it has to fly');

  await console.press('Draw a route…');
  assert.equal(await console.page.getByLabel('Who flies it').inputValue(), WHO);
  const height = console.page.getByLabel('Height of the next point, in metres above ground');
  const first = [40, -6];
  const end = [36, -12];
  await height.fill('4');
  await console.clickAt(...first);
  await height.fill('6');
  await console.clickAt(...end);
  await picture('route');
  await console.press('Rehearse');
  const rows = console.page.locator('.rehearsal tbody tr');
  await console.until('it is rehearsed', async () => (await rows.count()) === console.fleet.vehicles.length, 60);
  const mine = console.page.locator(`.rehearsal tr[data-vehicle="${WHO}"]`);
  assert.match(await mine.textContent(), /3 of 3/);
  await picture('rehearsal');
  // The dialog sends what it has shown.
  await console.page.locator('.rehearsal').getByRole('button', { name: 'Send', exact: true }).click();
  await console.acknowledged('route', [WHO]);
  const near = (point, place) => apart(point, place) < 1;
  const told = await console.until('it tells the route as its own', () => {
    const { way } = console.vehicle(WHO);
    return way.length > 0 && near(way.at(-1), end) && way;
  });
  assert.ok(Math.abs(told.at(-1)[2] - 6) < 0.1, `the height is ${told.at(-1)[2]}`);

  // Changed in flight: what it still has to fly, and one more point.
  await console.press('Draw a route…');
  await console.press('Its own');
  const beyond = [31, -15];
  await height.fill('4');
  await console.clickAt(...beyond);
  await picture('edited');
  await console.press('Send');
  await console.until('it tells the new end', () => near(console.vehicle(WHO).way.at(-1) ?? [1e9, 0], beyond));
  await console.until('it lands there', () => console.vehicle(WHO).mission === 'complete', 90);
  assert.ok(near(console.vehicle(WHO).position, beyond), `it landed at ${console.vehicle(WHO).position}`);
  assert.ok(console.history(WHO).some(({ position }) => near(position, end)), 'it was at the point before');
  await console.stay(90);
});
