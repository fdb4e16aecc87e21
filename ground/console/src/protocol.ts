/**
 * How the station's messages are read, and the types of what is read.
 *
 * Reading is forgiving: a field that is missing or of the wrong kind becomes `null` or empty, so that one odd vehicle
 * never takes the others off the screen. Only a message that is no JSON object of a known type is refused. The types are
 * the station's own, from `messages.ts`, but for what may be `null` here.
 */

import type * as station from './messages';
import { What, ZoneKind } from './vocabulary';
import type { ZoneTable } from './zone';

/** The station's message of this type. */
type Told<Type extends station.ServerMessage['type']> = Extract<station.ServerMessage, { type: Type }>;

/** The console's message of this type. */
type Asked<Type extends station.ClientMessage['type']> = Extract<station.ClientMessage, { type: Type }>;

/** The same with some fields of another type. */
type With<T, Fields> = Omit<T, keyof Fields> & Fields;

/** The same with some fields that may be missing. */
type Doubtful<T, Field extends keyof T> = With<T, { [F in Field]: T[F] | null }>;

type Json = Record<string, unknown>;

/** What has arrived as a `T`: any of its fields, of any kind. */
type Raw<T> = Json & { readonly [Field in T extends unknown ? keyof T : never]?: unknown };

export type Vec3 = [x: number, y: number, z: number];
export type Quaternion = [x: number, y: number, z: number, w: number];

export type Bounds = station.Bounds;
export type Obstacle = station.Obstacle;
export type Scene = Told<'scene'>;

/** A vehicle; what it says of itself may be missing. */
export type Vehicle = With<Omit<station.VehicleView, keyof station.StateView>, { checks: Check[] }> &
  Doubtful<station.StateView, 'position' | 'velocity' | 'yaw_rad' | 'battery' | 'mission'>;
export type Check = With<station.CheckView, { state: CheckState }>;
export type CheckState = 'passes' | 'fails' | 'waits';
export type Outcome = station.OutcomeView;
export type Fleet = With<Told<'fleet'>, { vehicles: Vehicle[] }>;

export type Answer = Exclude<station.AnswerView, { state: 'acknowledged' }> | { state: 'acknowledged'; after_ms: number | null };
/** `script` is the one that it is about, or empty. */
export type Order = With<station.OrderView, { script: string; answers: Record<string, Answer> }>;

/** How a recording is played, which is shown in the place of a live swarm. */
export type Replay = Told<'replay'>;

/** Something drawn on the map. */
export type Zone = With<station.ZoneView, { answers: Record<string, Answer> }>;

export type SwarmEvent = station.EventView;

export type Blocker = station.Blocker;
export type Requested = station.Request;
export type Change = station.Change;
export type PastEvent = station.EventNote;
export type Why = With<Told<'why'>, { situation: Doubtful<Pick<station.Situation, 'speed_m_s' | 'still_since_s'>, 'speed_m_s'> }>;

/** What a script's file says. */
export interface Script {
  name: string;
  about: string;
  parameters: Parameter[];
  /** All of it, as it is sent on. */
  file: unknown;
}

export const PARAMETER_KINDS = ['number', 'integer', 'node', 'point', 'route'] as const;

export interface Parameter {
  name: string;
  about: string;
  kind: (typeof PARAMETER_KINDS)[number];
  unit: string;
  default: Argument | null;
  min: number | null;
  max: number | null;
}

export type Argument = number | string | Vec3 | Vec3[];

export type Range = station.Range;
export type Played = Doubtful<Omit<station.Played, 'lands_s' | 'battery'> & { lands_s: Range; battery: Range }, 'lands_s' | 'battery'>;

/** The outcome of a rehearsal. */
export interface Rehearsal {
  type: 'rehearsed';
  tag: string;
  flights: number;
  succeeded: boolean;
  vehicles: Played[];
  nearest: station.Nearness[];
  clearance_m: number | null;
  collisions: [number, number];
  left_out: Record<string, string>;
}

export type ServerMessage =
  | Scene
  | Fleet
  | With<Told<'orders'>, { orders: Order[] }>
  | Told<'events'>
  | Replay
  | With<Told<'replayed'>, { tag: string }>
  | With<Told<'zones'>, { zones: Zone[] }>
  | With<Told<'mapped'>, { tag: string }>
  | Rehearsal
  | Why
  | You
  | Offer
  | With<Told<'ordered'>, { tag: string; id: number | null }>
  | With<Told<'script'>, { tag: string; script: Script }>
  | Told<'error'>;

/** Who the station takes this browser for. */
export type You = With<Told<'you'>, { tag: string }>;

/** What a launch would launch. */
export type Offer = With<Told<'offer'>, { tag: string; what: typeof What.launch | typeof What.launchTogether }>;

/** The orders that have a button. */
export type Command = Exclude<
  What,
  | typeof What.handBack
  | typeof What.load
  | typeof What.unload
  | typeof What.ask
  | typeof What.give
  | typeof What.take
  | typeof What.release
  | typeof What.keep
>;

/** A go-to's place; without a height every vehicle keeps its own. */
export type Point = [x: number, y: number, z: number | null];

/** Asks to be told why a vehicle does what it does, again and again; `null` ends that. */
export type Question = Asked<'why'>;

/** What this console says. But for questions, all of it is answered under its tag. */
export type ClientMessage = ((Asked<'order'> | Asked<'read_script'> | Asked<'hello'> | Asked<'draw'> | Asked<'erase'> | Asked<'replay'> | Asked<'rehearse'>) & { tag: string }) | Question;

/** Reads a message of the station; `null` if it is none that this console knows. */
export function readMessage(text: string): ServerMessage | null {
  let json: unknown;
  try {
    json = JSON.parse(text);
  } catch {
    return null;
  }
  if (!isRecord(json)) return null;
  switch (json.type) {
    case 'scene':
      return readScene(json);
    case 'fleet':
      return {
        type: 'fleet',
        time_s: number(json.time_s) ?? 0,
        outcome: isRecord(json.outcome) ? readOutcome(json.outcome) : null,
        vehicles: list(json.vehicles, readVehicle),
      };
    case 'orders':
      return { type: 'orders', orders: list(json.orders, readOrder) };
    case 'events':
      return { type: 'events', events: list(json.events, readEvent), anew: json.anew === true };
    case 'replay':
      return readReplay(json);
    case 'replayed':
      return { type: 'replayed', tag: string(json.tag) };
    case 'zones':
      return { type: 'zones', zones: list(json.zones, readZone) };
    case 'mapped':
      return { type: 'mapped', tag: string(json.tag), name: string(json.name) };
    case 'rehearsed':
      return readRehearsal(json);
    case 'why':
      return readWhy(json);
    case 'you':
      return readYou(json);
    case 'offer':
      return readOffer(json);
    case 'ordered':
      return { type: 'ordered', tag: string(json.tag), id: number(json.id) };
    case 'script':
      return isRecord(json.script) ? { type: 'script', tag: string(json.tag), script: readScript(json.script) } : null;
    case 'error':
      return {
        type: 'error',
        tag: typeof json.tag === 'string' ? json.tag : null,
        message: string(json.message) || 'The station refused without saying why.',
      };
    default:
      return null;
  }
}

/** Whoever has no role that this console knows sees, and orders nothing. */
function readYou(json: Raw<Told<'you'>>): You {
  const role = json.role === 'operator' || json.role === 'safety' ? json.role : 'observer';
  return { type: 'you', tag: string(json.tag), name: string(json.name) || null, role, certified: json.certified === true };
}

function readOffer(json: Raw<Told<'offer'>>): Offer | null {
  const [token, what] = [string(json.token), json.what];
  if (!token || (what !== What.launch && what !== What.launchTogether)) return null;
  const vehicles = list(json.vehicles, ({ name, task, doubts }: Raw<station.CandidateView>) => ({
    name: string(name),
    task: string(task),
    doubts: strings(doubts),
  }));
  return { type: 'offer', tag: string(json.tag), token, what, lasts_s: number(json.lasts_s) ?? 0, vehicles };
}

function readScene(json: Raw<Told<'scene'>>): Scene {
  const min = isRecord(json.bounds) ? vector(json.bounds.min) : null;
  const max = isRecord(json.bounds) ? vector(json.bounds.max) : null;
  return {
    type: 'scene',
    fleet: string(json.fleet),
    station: string(json.station),
    software: string(json.software),
    recording: string(json.recording),
    bounds: min && max ? { min, max } : null,
    obstacles: list(json.obstacles, readObstacle),
  };
}

function readObstacle(json: Raw<station.Obstacle>): Obstacle | null {
  const position = vector(json.position);
  if (!position) return null;
  const place = { position, orientation: quaternion(json.orientation) };
  const radius = number(json.radius);
  if (json.form === 'box') {
    const size = vector(json.size);
    return size && { form: 'box', size, ...place };
  }
  if (json.form === 'cylinder') {
    const height = number(json.height);
    return radius === null || height === null ? null : { form: 'cylinder', radius, height, ...place };
  }
  if (json.form === 'sphere') {
    return radius === null ? null : { form: 'sphere', radius, ...place };
  }
  return null;
}

function readVehicle(json: Raw<station.VehicleView | station.StateView>): Vehicle | null {
  const name = string(json.name);
  if (!name) return null;
  const link: Raw<station.LinkView> = isRecord(json.link) ? json.link : {};
  const heard = json.heard === true;
  return {
    name,
    heard,
    position: heard ? vector(json.position) : null,
    velocity: vector(json.velocity),
    yaw_rad: number(json.yaw_rad),
    radius_m: number(json.radius_m) ?? 0.25,
    mode: string(json.mode),
    armed: json.armed === true,
    battery: number(json.battery),
    task: string(json.task),
    waiting_for: string(json.waiting_for),
    mission: json.mission === 'complete' || json.mission === 'failed' || json.mission === 'under_way' ? json.mission : null,
    path: Array.isArray(json.path) ? json.path.map(vector).filter((point) => point !== null) : [],
    way: Array.isArray(json.way) ? json.way.map(vector).filter((point) => point !== null) : [],
    scripts: strings(json.scripts),
    zones: strings(json.zones),
    holder: string(json.holder),
    asked_by: string(json.asked_by),
    link: { alive: link.alive === true, age_ms: number(link.age_ms) },
    notes: strings(json.notes),
    checks: list(json.checks, readCheck),
  };
}

/** One whose state is none that this console knows does not pass as far as it can tell. */
function readCheck(json: Raw<station.CheckView>): Check | null {
  const name = string(json.name);
  const state = json.state === 'passes' || json.state === 'fails' ? json.state : 'waits';
  return name ? { name, state, value: string(json.value), advice: string(json.advice) } : null;
}

function readScript(json: Json): Script {
  const parameters = isRecord(json.parameters) ? Object.entries(json.parameters) : [];
  return {
    name: string(json.name),
    about: string(json.about),
    parameters: parameters.flatMap(([name, value]) => {
      const parameter = isRecord(value) ? readParameter(name, value) : null;
      return parameter ? [parameter] : [];
    }),
    file: json,
  };
}

function readParameter(name: string, json: Json): Parameter | null {
  const kind = PARAMETER_KINDS.find((known) => known === json.type);
  if (!kind) return null;
  const [min, max] = [number(json.min), number(json.max)];
  return { name, about: string(json.about), kind, unit: string(json.unit), default: (json.default as Argument | undefined) ?? null, min, max };
}

function readOutcome(json: Raw<station.OutcomeView>): Outcome {
  const failed = isRecord(json.failed) ? json.failed : {};
  return {
    succeeded: json.succeeded === true,
    failed: Object.fromEntries(Object.entries(failed).map(([name, why]) => [name, string(why)])),
  };
}

function readOrder(json: Raw<station.OrderView>): Order | null {
  const id = number(json.id);
  if (id === null) return null;
  return {
    id,
    by: string(json.by),
    what: string(json.what),
    script: string(json.script),
    time_s: number(json.time_s) ?? 0,
    answers: readAnswers(json.answers),
  };
}

function readAnswers(json: unknown): Record<string, Answer> {
  const answers = isRecord(json) ? json : {};
  return Object.fromEntries(Object.entries(answers).map(([name, answer]) => [name, readAnswer(answer)]));
}

function readReplay(json: Raw<Replay>): Replay {
  const [from, to] = [number(json.from_s) ?? 0, number(json.to_s) ?? 0];
  return {
    type: 'replay',
    at_s: number(json.at_s) ?? from,
    from_s: from,
    to_s: to,
    playing: json.playing === true,
    speed: number(json.speed) ?? 1,
    complete: json.complete === true,
  };
}

function readRehearsal(json: Json): Rehearsal {
  const said: Raw<station.Rehearsed> = isRecord(json.rehearsed) ? json.rehearsed : {};
  const [obstacles, vehicles] = Array.isArray(said.collisions) ? said.collisions.map(number) : [];
  const left = isRecord(json.left_out) ? json.left_out : {};
  return {
    type: 'rehearsed',
    tag: string(json.tag),
    flights: Array.isArray(said.seeds) ? said.seeds.length : 0,
    succeeded: said.succeeded === true,
    vehicles: list(said.vehicles, (played: Raw<station.Played>) => ({
      vehicle: string(played.vehicle),
      arrives: number(played.arrives) ?? 0,
      lands_s: range(played.lands_s),
      battery: range(played.battery),
      waits: list(played.waits, (wait: Raw<station.Wait>) => ({ waits_for: string(wait.waits_for), mean_s: number(wait.mean_s) ?? 0 })),
      fails: list(played.fails, (failure: Raw<station.Failure>) => ({ why: string(failure.why), seeds: number(failure.seeds) ?? 0 })),
    })),
    nearest: list(said.nearest, (near: Raw<station.Nearness>) => {
      const [one, other] = strings(near.who);
      const [distance_m, at_s] = [number(near.distance_m), number(near.at_s)];
      return one === undefined || other === undefined || distance_m === null || at_s === null ? null : { who: [one, other] as [string, string], distance_m, at_s, seed: number(near.seed) ?? 0 };
    }),
    clearance_m: number(said.clearance_m),
    collisions: [obstacles ?? 0, vehicles ?? 0],
    left_out: Object.fromEntries(Object.entries(left).map(([name, why]) => [name, string(why)])),
  };
}

function range(json: unknown): Range | null {
  const [least, mean, most] = isRecord(json) ? [number(json.least), number(json.mean), number(json.most)] : [null, null, null];
  return least === null || mean === null || most === null ? null : { least, mean, most };
}

/** A zone of a kind that this console does not know cannot be shown. */
function readZone(json: Raw<station.ZoneView>): Zone | null {
  const table: Raw<ZoneTable> = isRecord(json.zone) ? json.zone : {};
  const kind = Object.values(ZoneKind).find((known) => known === table.kind);
  if (!kind || !string(table.name)) return null;
  const numbers = ['radius_m', 'floor_m', 'ceiling_m', 'height_m', 'from_s', 'until_s'] as const;
  const given = numbers.flatMap((field) => (number(table[field]) === null ? [] : [[field, number(table[field])]]));
  const centre = place(table.centre_m);
  const corners = Array.isArray(table.corners_m) ? table.corners_m.map(place).filter((corner) => corner !== null) : null;
  const zone: ZoneTable = {
    name: string(table.name),
    kind,
    ...(centre && { centre_m: centre }),
    ...(corners && { corners_m: corners }),
    ...Object.fromEntries(given),
  };
  return { zone, by: string(json.by), time_s: number(json.time_s) ?? 0, going: json.going === true, answers: readAnswers(json.answers) };
}

function place(json: unknown): [number, number] | null {
  const [x, y] = Array.isArray(json) ? json.map(number) : [];
  return x === null || x === undefined || y === null || y === undefined ? null : [x, y];
}

function readAnswer(json: unknown): Answer {
  const answer: Raw<station.AnswerView> = isRecord(json) ? json : {};
  switch (answer.state) {
    case 'acknowledged':
      return { state: 'acknowledged', after_ms: number(answer.after_ms) };
    case 'missing':
      return { state: 'missing' };
    case 'refused':
      return { state: 'refused', why: string(answer.why) };
    default:
      return { state: 'pending' };
  }
}

function readEvent(json: Raw<station.EventView>): SwarmEvent | null {
  const name = string(json.name);
  if (!name) return null;
  return {
    time_s: number(json.time_s) ?? 0,
    home: string(json.home),
    seq: number(json.seq) ?? 0,
    name,
    data: isRecord(json.data) ? json.data : {},
    requested_by: strings(json.requested_by),
    blocked_by: strings(json.blocked_by),
  };
}

function readWhy(json: Raw<Told<'why'>>): Why {
  const situation: Raw<station.Situation> = isRecord(json.situation) ? json.situation : {};
  return {
    type: 'why',
    vehicle: string(json.vehicle),
    time_s: number(json.time_s) ?? 0,
    headline: string(json.headline),
    situation: { speed_m_s: number(situation.speed_m_s), still_since_s: number(situation.still_since_s) },
    requests: list(json.requests, readRequested),
    changes: list(json.changes, ({ because, needed, cycle }: Raw<station.Change>) => ({
      because: strings(because),
      needed: strings(needed),
      cycle: strings(cycle),
    })),
    events: list(json.events, readPastEvent),
    limits: strings(json.limits),
    doubts: strings(json.doubts),
  };
}

function readRequested(json: Raw<station.Request>): Requested | null {
  const event = string(json.event);
  if (!event) return null;
  return {
    event,
    by: string(json.by),
    priority: number(json.priority),
    blocked_by: list(json.blocked_by, (blocker: Raw<station.Blocker>) => ({
      node: string(blocker.node),
      bthread: string(blocker.bthread),
      local: blocker.local === true,
      lease_age_s: number(blocker.lease_age_s),
      lease_s: number(blocker.lease_s),
    })),
  };
}

function readPastEvent(json: Raw<station.EventNote>): PastEvent | null {
  const event = string(json.event);
  if (!event) return null;
  return {
    time_s: number(json.time_s) ?? 0,
    event,
    home: string(json.home),
    requested_by: strings(json.requested_by),
    choice: string(json.choice) || null,
  };
}

function isRecord(json: unknown): json is Json {
  return typeof json === 'object' && json !== null && !Array.isArray(json);
}

function number(json: unknown): number | null {
  return typeof json === 'number' && Number.isFinite(json) ? json : null;
}

function string(json: unknown): string {
  return typeof json === 'string' ? json : '';
}

function strings(json: unknown): string[] {
  return Array.isArray(json) ? json.filter((item) => typeof item === 'string') : [];
}

function vector(json: unknown): Vec3 | null {
  if (!Array.isArray(json) || json.length < 3) return null;
  const [x, y, z] = json.map(number);
  return x == null || y == null || z == null ? null : [x, y, z];
}

function quaternion(json: unknown): Quaternion {
  const [x, y, z, w] = Array.isArray(json) ? json.map(number) : [];
  return x == null || y == null || z == null || w == null ? [0, 0, 0, 1] : [x, y, z, w];
}

function list<T>(json: unknown, read: (item: Json) => T | null): T[] {
  if (!Array.isArray(json)) return [];
  return json.flatMap((item) => {
    const value = isRecord(item) ? read(item) : null;
    return value === null ? [] : [value];
  });
}
