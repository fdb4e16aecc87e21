/**
 * The operator's console: joins the parts, and decides what a message or an input changes.
 */

import './console.css';
import { Commands } from './commands';
import { Confirmation } from './confirmation';
import { Connection, liveUrl } from './connection';
import { html, part, setText } from './dom';
import { Drawing } from './drawing';
import { EventsPanel } from './events-panel';
import { Help } from './help';
import { HolderPanel } from './holder-panel';
import { holdingNews } from './holding';
import { identities } from './identity';
import { listenToKeys } from './keys';
import { LaunchDialog } from './launch-dialog';
import { Banner, Notices } from './notices';
import { OrdersPanel } from './orders-panel';
import { Person } from './person';
import { Placing } from './placing';
import type { ClientMessage, Command, Fleet, Point, Question, Scene, Script, ServerMessage, Vec3, Zone } from './protocol';
import { addresseeWords, Selection } from './selection';
import { Theme } from './theme';
import { VehiclesPanel } from './vehicles-panel';
import { What } from './vocabulary';
import { View } from './view/view';
import { WhyPanel } from './why-panel';
import { RehearsalDialog } from './rehearsal-dialog';
import { ReplayBar } from './replay-bar';
import { RoutesPanel } from './routes-panel';
import { Routing } from './routing';
import { showScript } from './script-dialog';
import { ScriptsPanel } from './scripts-panel';
import { TypedNumber } from './typed-number';
import { ZonesPanel } from './zones-panel';
import { clockWords, durationWords, orderName, outcomeWords, overWords } from './words';

/** The station speaks ten times a second; after this long what is shown is no longer live. */
const STALE_MS = 2000;
/** Connecting is not worth a banner before this. */
const GRACE_MS = 1500;
/** An order that the station has not taken by then was probably not heard. */
const ANSWER_MS = 3000;

/** A rehearsal among unanswered requests, and the time that it may take. */
const REHEARSAL = 'rehearsal';
const REHEARSED_MS = 150_000;
/** How requests about zones are called. */
const ZONE = 'zone';

/** An order that the station has not answered yet. */
interface Sent {
  what: string;
  timer: number;
  point?: Point;
}

const selection: Selection = new Selection(selectionChanged);
const view = new View(part('view'), {
  picked: (name, more) => (more ? selection.toggle(name) : selection.pick(name)),
  placed: (place) => (routing.active ? routing.add(rounded(place), view.groundZ) : drawing.active ? drawing.add(rounded(place)) : goTo(place)),
});
const theme = new Theme(() => view.repaint());
const vehicles = new VehiclesPanel(part('vehicles'), part('vehicles-note'), selection);
const events = new EventsPanel(part('events-head'), part('events'), selection);
const why = new WhyPanel(part('why'), part('why-title'), part('why-note'), part('why-body'));
const orders = new OrdersPanel(part('answers'));
const scripts = new ScriptsPanel(part('vehicles'), withdraw, (file) => void readScript(file));
const zonesPanel = new ZonesPanel(part('vehicles'), erase, () => drawing.set(!drawing.active, zones.map(({ zone }) => zone.name)));
const routesPanel = new RoutesPanel(part('vehicles'), toggleRouting, () => rehearse({}, null));
const notices = new Notices(part('notices'));
const connectionBanner = new Banner(part('banners'), 'alert');
const outcomeBanner = new Banner(part('banners'), 'status');
const help = new Help(part('help-open'));
const placing = new Placing(part('view').parentElement!, (on) => {
  if (on) [drawing, routing].forEach((other) => other.set(false));
  view.setPlacing(on || drawing.active || routing.active);
  commands.setPlacing(on);
});
const drawing: Drawing = new Drawing(part('view').parentElement!, {
  changed: (on, places, radius) => {
    if (on) [placing, routing].forEach((other) => other.set(false));
    view.setPlacing(on || placing.active || routing.active);
    view.setDrawn(places, radius);
    zonesPanel.setDrawing(on);
  },
  drawn: (zone) => person.named(What.load, () => send({ type: 'draw', tag: newTag(), zone })),
});
const routing: Routing = new Routing(part('view').parentElement!, {
  changed: (on, vehicle, points) => {
    if (on) [placing, drawing].forEach((other) => other.set(false));
    view.setPlacing(on || placing.active || drawing.active);
    view.setRoute(on ? { vehicle, points } : null);
    routesPanel.setRouting(on);
  },
  rehearse: (vehicle, points) => rehearse({ [vehicle]: [...points] }, () => sendRoute(vehicle, points)),
  send: sendRoute,
  told: (vehicle) => fleet.vehicles.find(({ name }) => name === vehicle)?.way ?? [],
});
const rehearsal = new RehearsalDialog();
const replay = new ReplayBar(part('view').parentElement!, (wish) => send({ type: 'replay', tag: newTag(), ...wish }));
const confirmation = new Confirmation();
const commands = new Commands(part('commands'), {
  order: (what) => confirmed(what, () => order(what)),
  launch: () => person.named(What.launch, () => launch.open()),
  placing: () => placing.toggle(),
  everyone: () => selection.set([]),
});

const person: Person = new Person(part('person'), (name) => send({ type: 'hello', tag: newTag(), name }), (why) => notices.show(`${why}.`));
const holders = new HolderPanel(part('holders'), (what, to, name) =>
  person.named(what, () => send({ type: 'order', tag: newTag(), what, to, ...(name && { name }) })),
);
const launch = new LaunchDialog(
  (what) => send({ type: 'order', tag: newTag(), what, to: 'all' }),
  (what, token) => send({ type: 'order', tag: newTag(), what, to: 'all', token }),
);

let fleet: Fleet = { type: 'fleet', time_s: 0, outcome: null, vehicles: [] };
let zones: Zone[] = [];
/** Where the mission is recorded; empty while nobody says so. */
let recording = '';
const typed = new TypedNumber((number) => named(number) !== undefined);
/** By tag. */
const unanswered = new Map<string, Sent>();
let tags = 0;
/** When the next attempt to connect comes, on the clock of `performance.now()`. */
let retryAt = 0;
let everLive = false;

const connection = new Connection(liveUrl(window.location), { message: receive, changed: connectionChanged });
connectionChanged(false, 0);
selectionChanged();
window.setInterval(showConnection, 250);

part('theme').addEventListener('click', () => theme.toggle());
part('fit').addEventListener('click', () => view.fit());
listenToKeys(
  {
    h: () => commands.press(What.hold),
    r: () => commands.press(What.resume),
    b: () => commands.press(What.return),
    l: () => commands.press(What.land),
    g: () => commands.press(What.goto),
    0: () => selection.set(names()),
    a: () => selection.set(names()),
    f: () => view.fit(),
    t: () => theme.toggle(),
    w: () => why.focus(),
    p: () => replay.toggle(),
    e: toggleRouting,
    z: () => drawing.set(!drawing.active, zones.map(({ zone }) => zone.name)),
    '?': () => help.open(),
    Escape: () => (placing.active ? placing.set(false) : drawing.active ? drawing.set(false) : routing.active ? routing.set(false) : selection.set([])),
  },
  (digit, more) => {
    const number = typed.type(digit, performance.now());
    const name = number === null ? undefined : named(number);
    if (name) more ? selection.toggle(name) : selection.pick(name);
    return name !== undefined;
  },
);

function receive(message: ServerMessage): void {
  switch (message.type) {
    case 'scene':
      showStation(message);
      recording = message.recording;
      view.setScene(message);
      vehicles.setGround(view.groundZ);
      break;
    case 'fleet':
      tellHoldings(fleet, message);
      fleet = message;
      showFleet();
      break;
    case 'you':
      settle(message.tag);
      person.hear(message);
      showRights();
      showAddressees();
      break;
    case 'offer':
      if (settle(message.tag)) launch.show(message);
      break;
    case 'orders':
      orders.show(message.orders);
      break;
    case 'events':
      events.add(message.events, message.anew);
      break;
    case 'zones':
      zones = message.zones;
      zonesPanel.show(zones);
      view.setZones(zones);
      break;
    case 'mapped':
    case 'replayed':
      settle(message.tag);
      break;
    case 'rehearsed':
      if (settle(message.tag)) rehearsal.show(message);
      break;
    case 'replay':
      if (!replay.active) document.body.dataset.replay = '';
      replay.show(message);
      showRights();
      break;
    case 'why':
      why.show(message);
      break;
    case 'ordered': {
      const sent = settle(message.tag);
      if (sent?.point) view.setGoal(sent.point);
      if (sent?.what === What.return || sent?.what === What.land) view.setGoal(null);
      break;
    }
    case 'script':
      if (settle(message.tag)) offer(message.script);
      break;
    case 'error': {
      const sent = message.tag === null ? undefined : settle(message.tag);
      if (sent?.what === REHEARSAL) rehearsal.fail(message.message);
      else notices.show(sent ? `${orderName(sent.what)} was refused: ${message.message}` : message.message);
      break;
    }
  }
}

function showRights(): void {
  commands.setRights((what) => (replay.active ? 'This is a recording: nobody is ordered anything' : person.mayNot(what)));
}

/** What whoever sits here must notice of who holds what. */
function tellHoldings(before: Fleet, now: Fleet): void {
  for (const vehicle of now.vehicles) {
    const news = holdingNews(before.vehicles.find(({ name }) => name === vehicle.name), vehicle, person.name);
    if (news) notices.show(news);
  }
}

function showStation({ fleet, station, software }: Scene): void {
  const facts: [string, string][] = [['Fleet', fleet], ['Station', station], ['Version', software]];
  part('station').replaceChildren(
    ...facts.filter(([, value]) => value).map(([name, value]) => html('div', {}, html('dt', {}, name), html('dd', {}, value))),
  );
  document.title = fleet ? `Skein: ${fleet}` : 'Skein';
}

function showFleet(): void {
  const fleetNames = names();
  setText(part('clock'), clockWords(fleet.time_s));
  events.setFleet(fleetNames);
  orders.setFleet(fleetNames);
  vehicles.show(fleet);
  const asked = fleet.vehicles.find(({ name }) => selection.has(name));
  if (asked) why.showChecks(asked);
  scripts.show(fleet);
  view.setFleet(fleet);
  showAddressees();
  if (fleet.outcome) outcomeBanner.show(outcomeWords(fleet.outcome, fleetNames.length), fleet.outcome.succeeded ? 'good' : 'warn');
  else outcomeBanner.hide();
}

/** The vehicle of this number. */
function named(number: number): string | undefined {
  return [...identities(names())].find(([, look]) => look.number === number)?.[0];
}

function names(): string[] {
  return fleet.vehicles.map(({ name }) => name);
}

function selectionChanged(): void {
  askWhy();
  vehicles.showSelection();
  events.showSelection();
  view.setSelection(selection.names);
  showAddressees();
}

/** Asks the station about the selected vehicle: of several, the first. */
function askWhy(): void {
  const vehicle = names().find((name) => selection.has(name)) ?? null;
  why.ask(vehicle, selection.names.size);
  const question: Question = { type: 'why', vehicle };
  connection.send(question);
}

function showAddressees(): void {
  const to = selection.addressees(names());
  commands.setAddressees(addresseeWords(to, fleet.vehicles.length), to === 'all');
  const addressed = fleet.vehicles.filter(({ name }) => to === 'all' || to.includes(name));
  holders.show(addressed, person.name, person.mayNot(What.take));
}

/** Lands of everyone are asked about; what keeps vehicles where they are never is. */
function confirmed(what: Command, give: () => void): void {
  const all = selection.addressees(names()) === 'all';
  if (what === What.abort || (what === What.land && all)) confirmation.ask(what, fleet.vehicles.filter(({ armed }) => armed).length, give);
  else give();
}

function order(what: Command, point?: Point): void {
  const to = selection.addressees(names());
  person.named(what, () => send({ type: 'order', tag: newTag(), what, to, ...(point && { point }) }));
}

function withdraw(name: string, to: string[]): void {
  person.named(What.unload, () => send({ type: 'order', tag: newTag(), what: What.unload, name, to }));
}

function erase(name: string): void {
  person.named(What.load, () => send({ type: 'erase', tag: newTag(), name }));
}

function toggleRouting(): void {
  const flies = fleet.vehicles.filter(({ mission }) => mission === 'under_way').map(({ name }) => name);
  routing.set(!routing.active, flies, flies.find((name) => selection.has(name)));
}

function sendRoute(vehicle: string, points: readonly Vec3[]): void {
  routing.set(false);
  person.named(What.route, () => send({ type: 'order', tag: newTag(), what: What.route, to: [vehicle], points: [...points] }));
}

/** Has the fleet flown on in simulation; `give` sends what is rehearsed. */
function rehearse(routes: Record<string, Vec3[]>, give: (() => void) | null): void {
  person.named(What.route, () => {
    rehearsal.wait(give);
    send({ type: 'rehearse', tag: newTag(), routes });
  });
}

/** Asks the station what a script's file says. */
async function readScript(file: File): Promise<void> {
  send({ type: 'read_script', tag: newTag(), file: file.name, text: await file.text() });
}

function offer(script: Script): void {
  const to = selection.addressees(names());
  showScript(script, addresseeWords(to, fleet.vehicles.length), (values) =>
    person.named(What.load, () => send({ type: 'order', tag: newTag(), what: What.load, to, script: { script: script.file, with: values } })),
  );
}

function newTag(): string {
  tags += 1;
  return `${Date.now().toString(36)}-${tags}`;
}

function send(request: Exclude<ClientMessage, Question>): void {
  const { tag } = request;
  const what = request.type === 'order' ? request.what : request.type === 'hello' ? 'Your name' : request.type === 'read_script' ? What.load : request.type === 'replay' ? 'The recording' : request.type === 'rehearse' ? REHEARSAL : ZONE;
  const point = 'point' in request ? request.point : undefined;
  if (!connection.send(request)) {
    notices.show(`${orderName(what)} was not sent: there is no connection to the station.`);
    return;
  }
  const timer = window.setTimeout(() => {
    if (settle(tag)) notices.show(`${orderName(what)}: the station has not answered.`);
  }, what === REHEARSAL ? REHEARSED_MS : ANSWER_MS);
  unanswered.set(tag, { what, timer, ...(point && { point }) });
}

/** An order is answered, or no longer awaited; returns what it was. */
function settle(tag: string): Sent | undefined {
  const sent = unanswered.get(tag);
  if (!sent) return undefined;
  window.clearTimeout(sent.timer);
  unanswered.delete(tag);
  return sent;
}

function goTo(place: [x: number, y: number]): void {
  const metres = placing.metres;
  if (metres === undefined) {
    notices.show('The height must be a number of metres, or empty.');
    return;
  }
  if (!view.isWithin(place)) {
    notices.show('That place is outside the bounds.');
    return;
  }
  const [x, y] = rounded(place);
  const point: Point = [x, y, metres === null ? null : view.groundZ + metres];
  placing.set(false);
  order(What.goto, point);
}

function rounded(place: [x: number, y: number]): [x: number, y: number] {
  return place.map((coordinate) => Math.round(coordinate * 100) / 100) as [number, number];
}

function connectionChanged(live: boolean, retryMs: number): void {
  document.body.dataset.connection = live ? 'live' : 'lost';
  everLive ||= live;
  retryAt = performance.now() + retryMs;
  commands.setEnabled(live);
  if (live) {
    person.introduce();
    askWhy();
  }
  if (!live) {
    launch.close();
    confirmation.close();
    placing.set(false);
    drawing.set(false);
    routing.set(false);
    const lost = [...unanswered.keys()].map(settle);
    if (lost.length > 0) notices.show('The connection was lost before the station answered the last order.');
  }
  showConnection();
}

/** Also called now and then, for what only time changes. */
function showConnection(): void {
  const silence = performance.now() - connection.lastHeard;
  const live = document.body.dataset.connection === 'live';
  const stale = live && silence > STALE_MS;
  document.body.classList.toggle('stale', !live || stale);
  setText(part('connection'), !live ? (everLive ? 'Disconnected' : 'Connecting') : stale ? 'Silent' : replay.active ? 'Recording' : 'Live');
  if (!live && fleet.outcome) {
    setText(part('connection'), 'Over');
    connectionBanner.show(overWords(fleet.outcome, names().length, recording), fleet.outcome.succeeded ? 'good' : 'warn');
    outcomeBanner.hide();
  } else if (!live && !everLive && performance.now() < GRACE_MS) {
    connectionBanner.hide();
  } else if (!live) {
    const wait = Math.max(0, Math.ceil((retryAt - performance.now()) / 1000));
    const since = everLive ? `Connection to the station lost ${durationWords(Math.max(1000, silence))} ago. What you see is old.` : 'Not connected to the station yet.';
    connectionBanner.show(`${since} ${wait > 0 ? `Trying again in ${wait} s.` : 'Trying…'}`, everLive ? 'bad' : 'warn');
  } else if (stale) {
    connectionBanner.show(`The station has said nothing for ${durationWords(silence)}. What you see is old.`, 'warn');
  } else {
    connectionBanner.hide();
  }
}
