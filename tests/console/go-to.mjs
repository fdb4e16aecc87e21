// Go to moves one vehicle, Resume brings it back to its mission.
//
//     node go-to.mjs URL      beside `skein-sim fly open --headless`

import assert from 'node:assert/strict';
import { apart, drive, NAME, speed } from './browser.mjs';

const ONE = 'uav/1';
const OTHERS = ['uav/2', 'uav/3', 'uav/4'];
/** Far from everyone's way. */
const PLACE = [-8, -9];

await drive({}, async (console) => {
  await console.until(`${ONE} flies`, () => console.vehicle(ONE)?.task.startsWith('leg') && speed(console.vehicle(ONE)) > 1);
  await console.select(ONE);
  await console.goTo(...PLACE);
  const order = await console.acknowledged('goto', [ONE]);
  const [ordered, more] = await console.until('the order among the events', () => nonEmpty(console.happened(/^ground\/main\/ordered$/)));
  assert.equal(more, undefined, 'one order');
  assert.equal(ordered.data.what, 'goto');
  assert.equal(ordered.data.who, ONE);
  assert.equal(ordered.data.by, NAME);
  await console.until(`${ONE} is held by whoever ordered it`, () => console.vehicle(ONE).holder === NAME);
  await console.until('the page says so', async () => /In command: you/.test(await console.page.locator('#holders').textContent()));
  const { x, y, z } = ordered.data;
  assert.ok(apart([x, y], PLACE) < 0.5, `ordered to ${[x, y]}, clicked at ${PLACE}`);

  await console.until(`${ONE} is there`, () => apart(console.vehicle(ONE).position, [x, y]) < 1.5 && speed(console.vehicle(ONE)) < 0.5);
  const { position } = console.vehicle(ONE);
  assert.ok(Math.abs(position[2] - z) < 1, `it kept its height of ${z} m: ${position}`);
  assert.deepEqual(
    console.happened(/^uav\/\d+\/order$/).map(({ home }) => home),
    [ONE],
  );
  assert.deepEqual(
    console.happened(/^uav\/\d+\/goto$/, order.time_s).filter(({ home, data }) => home !== ONE && data.leg !== 0),
    [],
    'the others fly to their own goals',
  );

  await console.selectNone();
  await console.press('Resume');
  await console.acknowledged('resume', [ONE, ...OTHERS]);
  await console.until(`${ONE} leaves`, () => apart(console.vehicle(ONE).position, [x, y]) > 5);
  await console.stay();
  // Straight across the field: uav/2 eastward, the others northward, each near the middle line.
  for (const name of OTHERS) {
    const aside = Math.max(...console.history(name).filter(({ heard }) => heard).map(({ position }) => Math.abs(position[name === 'uav/2' ? 1 : 0])));
    assert.ok(aside < 4, `${name} was ${aside} m aside of its way`);
  }
});

function nonEmpty(list) {
  return list.length > 0 && list;
}
