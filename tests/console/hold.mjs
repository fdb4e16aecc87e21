// Hold stops the swarm, Resume lets it go on.
//
//     node hold.mjs URL      beside `skein-sim fly antipodal --vehicles 4 --headless`

import assert from 'node:assert/strict';
import { drive, speed } from './browser.mjs';

const NAMES = ['uav/1', 'uav/2', 'uav/3', 'uav/4'];
/** Who flies on is this far away after two seconds; who is held has not left its place by so much, m. */
const AWAY_M = 1;

await drive({}, async (console) => {
  const all = (wanted) => NAMES.every((name) => wanted(console.vehicle(name) ?? {}));
  await console.until('everyone flies', () => all((vehicle) => vehicle.task.startsWith('leg') && speed(vehicle) > 1));

  await console.press('Hold');
  const hold = await console.acknowledged('hold', NAMES);
  // When the page shows it is up to this computer.
  for (const [name, { after_ms }] of Object.entries(hold.answers)) assert.ok(after_ms < 1000, `${name} acknowledged after ${after_ms} ms`);

  const stopped = hold.time_s + 3;
  await console.until('five seconds on hold', () => console.fleet.time_s > stopped + 2);
  for (const name of NAMES) {
    const strayed = console.strayed(name, stopped);
    assert.ok(strayed < AWAY_M, `${name} has gone ${strayed} m while held`);
    const { position, waiting_for } = console.vehicle(name);
    assert.ok(position[2] > 1, `${name} is not in the air any more`);
    assert.match(waiting_for, /hold/, name);
  }

  // Who holds it is told beside the vehicle that is asked about, and what would free it.
  await console.select(NAMES[2]);
  const why = console.page.locator('#why');
  const reason = await console.until('the reason', async () => {
    const text = (await why.isVisible()) && (await why.textContent());
    return text && /stands still/.test(text) && text;
  });
  assert.match(reason, /`uav\/3\/advance` is requested by navigation and blocked by ground\/main#hold/);
  assert.match(reason, /It moves on when the operator orders Resume, Return, Land or Go to/);
  assert.match(reason, /blocked by ground\/main: hold, renewed \d+ ms ago/);
  await console.page.keyboard.press('w');
  assert.ok(await why.locator('.reasons').evaluate((region) => region === document.activeElement), 'the keyboard reaches the reason');
  await console.selectNone();
  assert.ok(await why.isHidden());

  const resumed = console.fleet.time_s;
  await console.press('Resume');
  await console.acknowledged('resume', NAMES);
  await console.until('everyone flies on', () => NAMES.every((name) => console.strayed(name, resumed) > AWAY_M), 10);
  await console.select(NAMES[2]);
  await console.until('it is not held any more', async () => /does what it does/.test(await why.textContent()) && !/blocked by/.test(await why.textContent()));
  await console.stay();
});
