// Takes the picture of the console that the README shows.
//
//     node screenshot.mjs URL OUT.png [light|dark]      beside `skein-sim fly forest --headless`

import { open, speed } from './browser.mjs';

const [url, file, colorScheme = 'dark'] = process.argv.slice(2);
if (!url || !file || !['light', 'dark'].includes(colorScheme)) {
  console.error('usage: node screenshot.mjs URL OUT.png [light|dark]');
  process.exit(2);
}

const shown = await open(url, { colorScheme, before: holdFrames });
try {
  const vehicles = () => shown.fleet?.vehicles ?? [];
  const flying = () => vehicles().filter((vehicle) => vehicle.task.startsWith('leg') && speed(vehicle) > 1);
  await shown.until('most vehicles are in flight', () => flying().length > vehicles().length * 0.75, 60);
  // The forest's operator holds everyone a little later, which shows what orders do.
  const held = (vehicle) => vehicle.waiting_for.includes('hold') && speed(vehicle) < 0.5;
  await shown.until('everyone is held', () => vehicles().every(held), 10);
  await shown.page.evaluate(() => window.releaseFrames());
  await shown.page.waitForTimeout(500);
  await shown.page.screenshot({ path: file });
  await shown.close();
} finally {
  await shown.browser.close();
}

/** Nothing is painted before the picture is taken: where a processor plays GPU, the view would become coarse meanwhile. */
function holdFrames() {
  const request = window.requestAnimationFrame.bind(window);
  const held = [];
  window.requestAnimationFrame = (frame) => held.push(frame);
  window.releaseFrames = () => {
    window.requestAnimationFrame = request;
    held.forEach(request);
  };
}
