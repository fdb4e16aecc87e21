// A script is sent from a file and withdrawn; then everybody lands together.
//
//     node script-and-abort.mjs URL      beside `skein-sim fly antipodal --vehicles 4 --headless`

import assert from 'node:assert/strict';
import { fileURLToPath } from 'node:url';
import { drive, speed } from './browser.mjs';

const NAMES = ['uav/1', 'uav/2', 'uav/3', 'uav/4'];
const CURFEW = fileURLToPath(new URL('../../agent/scripts/curfew.toml', import.meta.url));

await drive({}, async (console) => {
  const { page } = console;
  const all = (wanted) => NAMES.every((name) => wanted(console.vehicle(name) ?? {}));
  const choose = async (file) => {
    const chooser = page.waitForEvent('filechooser');
    await console.press('Send a script…');
    await (await chooser).setFiles(file);
  };
  await console.until('everyone flies', () => all((vehicle) => vehicle.mode === 'offboard' && speed(vehicle) > 1));
  // Whoever types has time.
  await console.press('Hold');
  await console.acknowledged('hold', NAMES);

  await choose({ name: 'broken.toml', mimeType: 'text/plain', buffer: Buffer.from('name = "broken"\nabout = 3\n') });
  const notice = page.locator('#notices');
  await console.until('the fault is told', async () => /Script was refused: broken\.toml:2/.test(await notice.textContent()));

  await choose(CURFEW);
  const dialog = page.locator('dialog[open]');
  await dialog.waitFor();
  assert.match(await dialog.textContent(), /curfew.*All 4 vehicles/s);
  const field = (name) => dialog.getByLabel(name);
  await field(/^min /).fill('-500, -500');
  await dialog.getByRole('button', { name: 'Send', exact: true }).click();
  assert.ok(await dialog.isVisible(), 'a point of two numbers is not sent');
  await field(/^min /).fill('-500, -500, -500');
  await field(/^max /).fill('500 500 500');
  await field(/^for s /).fill('600');
  if (process.argv[3]) await page.screenshot({ path: process.argv[3] });
  await dialog.getByRole('button', { name: 'Send', exact: true }).click();
  await console.acknowledged('load', NAMES);
  await console.until('the curfew is in force', () => all((vehicle) => vehicle.scripts.includes('curfew')));
  await console.press('Resume');
  await console.acknowledged('resume', NAMES);
  const resumed = console.fleet.time_s;
  await console.until('two seconds of curfew', () => console.fleet.time_s > resumed + 2);
  for (const name of NAMES) {
    const fastest = Math.max(...console.history(name, resumed).map(speed));
    assert.ok(fastest < 0.5, `${name} moves with ${fastest} m/s under curfew`);
  }

  await console.press('Withdraw');
  await console.acknowledged('unload', NAMES);
  await console.until('everyone flies on', () => all((vehicle) => vehicle.scripts.length === 0 && speed(vehicle) > 1), 5);

  await console.select(NAMES[1]);
  assert.ok(await page.getByRole('button', { name: 'Abort', exact: true }).isDisabled(), 'what is decided together is for all');
  await console.selectNone();
  await console.press('Abort');
  await console.until('everyone lands', () => all((vehicle) => vehicle.mode === 'land'), 3);
  await console.stay();
});
