// The console in a real browser, and what the station tells it.

import assert from 'node:assert/strict';
import { chromium } from 'playwright-core';

const EXECUTABLE = process.env.SKEIN_CHROMIUM ?? '/usr/bin/chromium';
/** Who sits at the browser. */
export const NAME = 'Anna';
const ARGUMENTS = ['--no-sandbox', '--disable-background-networking', '--no-first-run'];
/** The station speaks ten times a second; whoever waits for something asks it this often. */
const GLANCE_MS = 20;

/** Opens the console at `url`, painted with WebGL or with `renderer: 'svg'`. `before` is run in the page before its own script. */
export async function open(url, { renderer = 'webgl', colorScheme = 'dark', before = () => {} } = {}) {
  const browser = await chromium.launch({
    executablePath: EXECUTABLE,
    ...(renderer === 'svg'
      ? { args: [...ARGUMENTS, '--disable-3d-apis'], ignoreDefaultArgs: ['--enable-unsafe-swiftshader'] }
      : { args: [...ARGUMENTS, '--enable-unsafe-swiftshader'] }),
  });
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 }, colorScheme });
  await page.addInitScript((name) => window.localStorage.setItem('skein-name', name), NAME);
  await page.addInitScript(before);
  const console = new Console(browser, page);
  await page.goto(url);
  await page.locator('#commands').waitFor({ timeout: 5000 }).catch(() => {
    throw new Error('the page is not the console: was it built with Node and the packages of ground/console?');
  });
  assert.equal(await page.locator('#view').getAttribute('data-renderer'), renderer);
  return console;
}

export class Console {
  /** Everything that has gone wrong in the page while it had a station. */
  errors = [];
  /** What the station has said of the swarm, ten times a second. */
  fleets = [];
  orders = [];
  /** What is drawn on the map. */
  zones = [];
  events = [];
  /** Whether the station has gone. Whatever the page then says of its attempts to reach it is as it should be. */
  gone = false;

  constructor(browser, page) {
    this.browser = browser;
    this.page = page;
    page.on('pageerror', (error) => this.gone || this.errors.push(String(error)));
    page.on('console', (message) => this.gone || message.type() !== 'error' || this.errors.push(message.text()));
    page.on('websocket', (socket) => {
      socket.on('framereceived', ({ payload }) => this.#hear(JSON.parse(payload)));
      socket.on('close', () => (this.gone = true));
    });
  }

  #hear(message) {
    if (message.type === 'fleet') this.fleets.push(message);
    if (message.type === 'orders') this.orders = message.orders;
    if (message.type === 'zones') this.zones = message.zones;
    if (message.type === 'events') this.events.push(...message.events);
  }

  get fleet() {
    return this.fleets.at(-1);
  }

  /** What the station last said of a vehicle. */
  vehicle(name) {
    return this.fleet?.vehicles.find((vehicle) => vehicle.name === name);
  }

  /** What it has said of it since its time `since`. */
  history(name, since = 0) {
    return this.fleets.filter(({ time_s }) => time_s >= since).map(({ vehicles }) => vehicles.find((vehicle) => vehicle.name === name));
  }

  /**
   * How far a vehicle has strayed, m, from where it was at the station's time `since`. Who stays where it is gives way
   * to others by a metre, and comes back.
   */
  strayed(name, since) {
    const [{ position: then }, ...later] = this.history(name, since);
    return Math.max(0, ...later.map(({ position }) => apart(then, position)));
  }

  /** What `look` finds, once it finds something. */
  async until(what, look, withinS = 30) {
    const deadline = performance.now() + withinS * 1000;
    for (;;) {
      const found = await look();
      if (found) return found;
      assert.ok(!this.gone, `the station has gone before this: ${what}`);
      assert.ok(performance.now() < deadline, `not within ${withinS} s: ${what}\n${this.#situation()}`);
      await pause();
    }
  }

  #situation() {
    const vehicles = (this.fleet?.vehicles ?? []).map((each) => `  ${each.name} ${each.mode} at ${each.position}, ${speed(each)} m/s: ${each.task}`);
    return [`At ${this.fleet?.time_s} s:`, ...vehicles, `  newest order: ${JSON.stringify(this.orders.at(-1))}`].join('\n');
  }

  /** Selects these vehicles and no others, by clicks in the list. */
  async select(...names) {
    for (const [index, name] of names.entries()) {
      await this.page.locator(`[role=option][data-vehicle="${name}"]`).click({ modifiers: index > 0 ? ['Control'] : [] });
    }
    const selected = await this.page.locator('[role=option][aria-selected=true]').evaluateAll((rows) => rows.map((row) => row.dataset.vehicle));
    assert.deepEqual(selected, names);
  }

  async selectNone() {
    await this.page.getByRole('button', { name: 'All vehicles', exact: true }).click();
    assert.equal(await this.page.locator('[role=option][aria-selected=true]').count(), 0);
  }

  /** Presses the button of this name. */
  async press(name) {
    await this.page.getByRole('button', { name, exact: true }).click();
  }

  /**
   * Waits until the page shows that these vehicles, and no others, have acknowledged the newest order, which is `what`.
   * Returns the order as the station tells of it.
   */
  async acknowledged(what, names, withinS = 10) {
    const newest = this.page.locator(`#answers [data-order-what="${what}"]`);
    const chips = (which) => newest.locator(which).evaluateAll((all) => all.map((chip) => chip.dataset.vehicle));
    await this.until(`${names} acknowledge ${what}`, async () => (await chips('.chip[data-answer=acknowledged]')).length === names.length, withinS);
    assert.deepEqual(await chips('.chip'), names);
    const id = Number(await newest.getAttribute('data-order-id'));
    return this.orders.find((order) => order.id === id);
  }

  /** Sends the selected vehicles to a place on the ground. */
  async goTo(x, y) {
    await this.press('Go to');
    await this.clickAt(x, y);
  }

  /** Clicks the place on the ground that the page itself calls `x` east, `y` north: the pointer is moved until it says so. */
  async clickAt(x, y) {
    const view = await this.page.locator('#view').boundingBox();
    const said = async (px, py) => {
      await this.page.mouse.move(px, py);
      const words = await this.page.locator('#view .cursor').textContent();
      const [, east, north] = /^(-?[\d.]+) E\s+(-?[\d.]+) N$/.exec(words) ?? assert.fail(`no place under the pointer: ${JSON.stringify(words)}`);
      return [Number(east), Number(north)];
    };
    // Newton's method: how the place changes with the pointer, then the step that would lead there.
    let [px, py] = [view.x + view.width / 2, view.y + view.height / 2];
    const step = 40;
    for (let round = 0; round < 6; round += 1) {
      const here = await said(px, py);
      const away = [x - here[0], y - here[1]];
      if (Math.hypot(...away) < 0.1) break;
      const right = (await said(px + step, py)).map((each, axis) => (each - here[axis]) / step);
      const down = (await said(px, py + step)).map((each, axis) => (each - here[axis]) / step);
      const area = right[0] * down[1] - right[1] * down[0];
      px += (away[0] * down[1] - away[1] * down[0]) / area;
      py += (right[0] * away[1] - right[1] * away[0]) / area;
    }
    const place = await said(px, py);
    assert.ok(Math.hypot(place[0] - x, place[1] - y) < 0.5, `the pointer is at ${place}, wanted ${[x, y]}`);
    await this.page.mouse.click(px, py);
  }

  /** The events of a name that this pattern matches which the station has told of since its time `since`. */
  happened(pattern, since = 0) {
    return this.events.filter((event) => pattern.test(event.name) && event.time_s >= since);
  }

  /** Looks on until the station has gone: it ends with the flight. */
  async stay(withinS = 60) {
    const deadline = performance.now() + withinS * 1000;
    while (!this.gone) {
      assert.ok(performance.now() < deadline, `the flight did not end within ${withinS} s\n${this.#situation()}`);
      await pause();
    }
  }

  async close() {
    const { errors } = this;
    this.gone = true;
    await this.browser.close();
    assert.deepEqual(errors, [], 'errors in the page');
  }
}

/** Runs a test with the console at the URL that the command line names. */
export async function drive(options, test) {
  const url = process.argv[2];
  if (!url) {
    globalThis.console.error(`usage: node ${process.argv[1]} URL`);
    process.exit(2);
  }
  const console = await open(url, options);
  try {
    await test(console);
    await console.close();
  } catch (error) {
    for (const each of console.errors) globalThis.console.error(`in the page: ${each}`);
    throw error;
  } finally {
    await console.browser.close();
  }
}

function pause() {
  return new Promise((resolve) => setTimeout(resolve, GLANCE_MS));
}

/** How fast a vehicle is, m/s. */
export function speed({ velocity }) {
  return velocity ? Math.hypot(...velocity) : 0;
}

/** How far apart two places are on the ground, m. */
export function apart(a, b) {
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}
