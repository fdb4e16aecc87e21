// Without WebGL: Go to by a click, then Return for this vehicle, Land for two others, while the last flies its mission.
//
//     node land-and-return.mjs URL      beside `skein-sim fly open --headless`

import assert from 'node:assert/strict';
import { apart, drive, speed } from './browser.mjs';

const RETURNS = 'uav/1';
const LAND = ['uav/2', 'uav/3'];
const PLACE = [-8, -9];

await drive({ renderer: 'svg' }, async (console) => {
  const flies = (name) => console.vehicle(name)?.task.startsWith('leg') && speed(console.vehicle(name)) > 1;
  await console.until(`${RETURNS} flies`, () => flies(RETURNS));
  const home = console.history(RETURNS).find(({ position }) => position)?.position;

  await console.select(RETURNS);
  await console.goTo(...PLACE);
  await console.acknowledged('goto', [RETURNS]);
  await console.until(`${RETURNS} is where it was sent`, () => apart(console.vehicle(RETURNS).position, PLACE) < 1.5);
  await console.press('Return');
  await console.acknowledged('return', [RETURNS]);

  await console.until(`${LAND} fly`, () => LAND.every(flies));
  await console.select(...LAND);
  await console.press('Land');
  const { time_s } = await console.acknowledged('land', LAND);
  await console.until(`${LAND} land`, () => LAND.every((name) => console.vehicle(name).mode === 'land'), 2);

  await console.until('all three are down', () => [RETURNS, ...LAND].every((name) => !console.vehicle(name).armed));
  assert.ok(apart(console.vehicle(RETURNS).position, home) < 1, `${RETURNS} came down at ${console.vehicle(RETURNS).position}, home is ${home}`);
  for (const name of LAND) {
    const [{ position: then }] = console.history(name, time_s);
    const { position: now } = console.vehicle(name);
    assert.ok(apart(then, now) < 4, `${name} was told to land at ${then} and came down at ${now}`);
  }
  await console.stay();
});
