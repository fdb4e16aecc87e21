// A script is sent from a file and withdrawn; then everybody lands together.
//
//     node script-and-abort.mjs URL      beside `skein-sim fly antipodal --vehicles 4 --headless`

import assert from 'node:assert/strict';
import { drive, speed } from './browser.mjs';

/** Who flies on is this far away after two seconds; who is kept has not left its place by so much, m. */
const AWAY_M = 1.5;

const NAMES = ['uav/1', 'uav/2', 'uav/3', 'uav/4'];
const PAUSE = `
name = "pause"
about = "Keeps the vehicle where it is for a while."
[parameters.near]
about = "Where it is looked for; not used."
type = "route"
[parameters.for_s]
about = "How long."
type = "number"
unit = "s"
[[body]]
within_s = "{for_s}"
do = [{ sync = { block = { any_data = "{me}/advance" } } }]
`;

await drive({}, async (console) => {
  const { page } = console;
  const all = (wanted) => NAMES.every((name) => wanted(console.vehicle(name) ?? {}));
  const choose = async (name, text) => {
    const chooser = page.waitForEvent('filechooser');
    await console.press('Send a script…');
    await (await chooser).setFiles({ name, mimeType: 'text/plain', buffer: Buffer.from(text) });
  };
  await console.until('everyone flies', () => all((vehicle) => vehicle.task.startsWith('leg') && speed(vehicle) > 1));
  // Whoever types has time.
  await console.press('Hold');
  await console.acknowledged('hold', NAMES);

  await choose('broken.toml', 'name = "broken"\nabout = 3\n');
  const notice = page.locator('#notices');
  await console.until('the fault is told', async () => /Script was refused: broken\.toml:2/.test(await notice.textContent()));

  await choose('pause.toml', PAUSE);
  const dialog = page.locator('dialog[open]');
  await dialog.waitFor();
  assert.match(await dialog.textContent(), /pause.*All 4 vehicles/s);
  const send = dialog.getByRole('button', { name: 'Send', exact: true });
  await dialog.getByLabel(/^near /).fill('1 2 3\n4, 5');
  await dialog.getByLabel(/^for s /).fill('600');
  await send.click();
  assert.ok(await dialog.isVisible(), 'a point of two numbers is not sent');
  await dialog.getByLabel(/^near /).fill('1 2 3\n4, 5, 6');
  await send.click();
  await console.acknowledged('load', NAMES);
  await console.until('the script runs', () => all((vehicle) => vehicle.scripts.includes('pause')));
  await console.press('Resume');
  await console.acknowledged('resume', NAMES);
  const resumed = console.fleet.time_s;
  await console.until('two seconds', () => console.fleet.time_s > resumed + 2);
  for (const name of NAMES) {
    const strayed = console.strayed(name, resumed);
    assert.ok(strayed < AWAY_M, `${name} has gone ${strayed} m though its script keeps it`);
  }

  const withdrawn = console.fleet.time_s;
  await console.press('Withdraw');
  await console.acknowledged('unload', NAMES);
  await console.until('everyone flies on', () => NAMES.every((name) => console.strayed(name, withdrawn) > AWAY_M), 10);
  assert.ok(all((vehicle) => vehicle.scripts.length === 0));

  await console.select(NAMES[1]);
  assert.ok(await page.getByRole('button', { name: 'Abort', exact: true }).isDisabled(), 'what is decided together is for all');
  await console.selectNone();
  const aborted = console.fleet.time_s;
  await console.press('Abort');
  const question = page.locator('dialog[open]');
  await question.waitFor();
  assert.match(await question.textContent(), /Abort all\?.*4 vehicles fly/s);
  assert.ok(console.orders.every(({ what }) => what !== 'abort'), 'nothing is ordered before it is confirmed');
  await question.getByRole('button', { name: 'Abort the mission', exact: true }).click();
  // In the middle of the circle they part first, so that one is down before another begins.
  const hasLanded = (name) => console.history(name, aborted).some((vehicle) => vehicle.mode === 'land');
  await console.until('everyone lands', () => NAMES.every(hasLanded));
  await console.stay();
  // The station has ended with the mission, and nothing is said to be lost.
  const banners = page.locator('#banners');
  await banners.getByText('The station has ended').waitFor({ timeout: 5000 });
  assert.match(await banners.textContent(), /Mission failed: 0 of 4 arrived.*It is recorded in .*mission\.mcap/s);
  assert.doesNotMatch(await page.locator('body').textContent(), /connection[^.]*lost/i);
  assert.equal(await page.locator('[role=option][data-vehicle]').count(), NAMES.length, 'the last state stays');
});
