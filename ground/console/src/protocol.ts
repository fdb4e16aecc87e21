/**
 * What the ground station and the console say to each other, and how its messages are read.
 *
 * Reading is forgiving: a field that is missing or of the wrong kind becomes `null` or empty, so that one odd vehicle
 * never takes the others off the screen. Only a message that is no JSON object of a known type is refused.
 */

import type { What } from './vocabulary';

export type Vec3 = [x: number, y: number, z: number];
export type Quaternion = [x: number, y: number, z: number, w: number];

export interface Bounds {
  min: Vec3;
  max: Vec3;
}

export type Obstacle = { position: Vec3; orientation: Quaternion } & (
  | { form: 'box'; size: Vec3 }
  | { form: 'cylinder'; radius: number; height: number }
  | { form: 'sphere'; radius: number }
);

export interface Scene {
  type: 'scene';
  fleet: string;
  station: string;
  software: string;
  bounds: Bounds | null;
  obstacles: Obstacle[];
}

export type MissionState = 'under_way' | 'complete' | 'failed';

export interface Vehicle {
  name: string;
  heard: boolean;
  position: Vec3 | null;
  velocity: Vec3 | null;
  yaw: number | null;
  radius: number;
  mode: string;
  armed: boolean;
  /** Energy left, 0 to 1. */
  battery: number | null;
  task: string;
  waitingFor: string;
  mission: MissionState | null;
  path: Vec3[];
  /** The names of the scripts that run on it. */
  scripts: string[];
  link: { alive: boolean; ageMs: number | null };
  notes: string[];
}

export interface Outcome {
  succeeded: boolean;
  /** Why, by vehicle. */
  failed: Record<string, string>;
}

export interface Fleet {
  type: 'fleet';
  time: number;
  outcome: Outcome | null;
  vehicles: Vehicle[];
}

export type Answer =
  | { state: 'acknowledged'; afterMs: number | null }
  | { state: 'pending' }
  | { state: 'missing' }
  | { state: 'refused'; why: string };

export interface Order {
  id: number;
  what: string;
  /** The script that it is about. */
  script: string;
  time: number;
  answers: Record<string, Answer>;
}

export interface Orders {
  type: 'orders';
  orders: Order[];
}

export interface SwarmEvent {
  time: number;
  home: string;
  /** Place in its home's sequence; 0 for an event that stayed local. */
  seq: number;
  name: string;
  data: Record<string, unknown>;
  requestedBy: string[];
  blockedBy: string[];
  leaseAgeMs: number | null;
}

export interface Events {
  type: 'events';
  events: SwarmEvent[];
}

export interface Blocker {
  node: string;
  bthread: string;
  /** Whether it runs on the vehicle itself. */
  local: boolean;
  leaseAge: number | null;
  lease: number | null;
}

/** Something that is requested of a vehicle. */
export interface Requested {
  event: string;
  by: string;
  priority: number | null;
  blockedBy: Blocker[];
}

/** A reason for which a vehicle stands still, and what would end it: any of `needed`. */
export interface Change {
  because: string[];
  needed: string[];
  cycle: string[];
}

export interface PastEvent {
  time: number;
  event: string;
  requestedBy: string[];
  choice: string;
}

/** Why a vehicle does what it does. Times are in seconds. */
export interface Why {
  type: 'why';
  vehicle: string;
  time: number;
  headline: string;
  speed: number | null;
  stillSince: number | null;
  requests: Requested[];
  changes: Change[];
  events: PastEvent[];
  doubts: string[];
}

export interface Ordered {
  type: 'ordered';
  tag: string;
  id: number | null;
}

export interface Refusal {
  type: 'error';
  tag: string | null;
  message: string;
}

/** What a script's file says. */
export interface ScriptAnswer {
  type: 'script';
  tag: string;
  script: Script;
}

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

export type ServerMessage = Scene | Fleet | Orders | Events | Why | Ordered | ScriptAnswer | Refusal;

/** The orders that have a button. */
export type Command = Exclude<What, typeof What.handBack | typeof What.load | typeof What.unload>;

/** A go-to's place; without a height every vehicle keeps its own. */
export type Point = [x: number, y: number, z: number | null];

export interface OrderRequest {
  type: 'order';
  tag: string;
  what: Command;
  to: 'all' | string[];
  point?: Point;
}

/** Asks to be told why a vehicle does what it does, again and again; `null` ends that. */
export interface Question {
  type: 'why';
  vehicle: string | null;
}

/** Asks what a script's file says. */
export interface ReadingRequest {
  type: 'read_script';
  tag: string;
  file: string;
  text: string;
}

/** Sends a script to vehicles, with values for its parameters. */
export interface ScriptRequest {
  type: 'order';
  tag: string;
  what: typeof What.load;
  to: 'all' | string[];
  script: { script: unknown; with: Record<string, Argument> };
}

/** Takes a script back. */
export interface WithdrawalRequest {
  type: 'order';
  tag: string;
  what: typeof What.unload;
  name: string;
  to: string[];
}

/** What this console says. */
export type ClientMessage = OrderRequest | ReadingRequest | ScriptRequest | WithdrawalRequest | Question;

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
        time: number(json.time_s) ?? 0,
        outcome: readOutcome(json.outcome),
        vehicles: list(json.vehicles, readVehicle),
      };
    case 'orders':
      return { type: 'orders', orders: list(json.orders, readOrder) };
    case 'events':
      return { type: 'events', events: list(json.events, readEvent) };
    case 'why':
      return readWhy(json);
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

type Json = Record<string, unknown>;

function readScene(json: Json): Scene {
  const min = isRecord(json.bounds) ? vector(json.bounds.min) : null;
  const max = isRecord(json.bounds) ? vector(json.bounds.max) : null;
  return {
    type: 'scene',
    fleet: string(json.fleet),
    station: string(json.station),
    software: string(json.software),
    bounds: min && max ? { min, max } : null,
    obstacles: list(json.obstacles, readObstacle),
  };
}

function readObstacle(json: Json): Obstacle | null {
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

function readVehicle(json: Json): Vehicle | null {
  const name = string(json.name);
  if (!name) return null;
  const link = isRecord(json.link) ? json.link : {};
  const heard = json.heard === true;
  return {
    name,
    heard,
    position: heard ? vector(json.position) : null,
    velocity: vector(json.velocity),
    yaw: number(json.yaw_rad),
    radius: number(json.radius_m) ?? 0.25,
    mode: string(json.mode),
    armed: json.armed === true,
    battery: number(json.battery),
    task: string(json.task),
    waitingFor: string(json.waiting_for),
    mission: json.mission === 'complete' || json.mission === 'failed' || json.mission === 'under_way' ? json.mission : null,
    path: Array.isArray(json.path) ? json.path.map(vector).filter((point) => point !== null) : [],
    scripts: strings(json.scripts),
    link: { alive: link.alive === true, ageMs: number(link.age_ms) },
    notes: strings(json.notes),
  };
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

function readOutcome(json: unknown): Outcome | null {
  if (!isRecord(json)) return null;
  const failed = isRecord(json.failed) ? json.failed : {};
  return {
    succeeded: json.succeeded === true,
    failed: Object.fromEntries(Object.entries(failed).map(([name, why]) => [name, string(why)])),
  };
}

function readOrder(json: Json): Order | null {
  const id = number(json.id);
  if (id === null) return null;
  const answers = isRecord(json.answers) ? json.answers : {};
  return {
    id,
    what: string(json.what),
    script: string(json.script),
    time: number(json.time_s) ?? 0,
    answers: Object.fromEntries(Object.entries(answers).map(([name, answer]) => [name, readAnswer(answer)])),
  };
}

function readAnswer(json: unknown): Answer {
  const answer = isRecord(json) ? json : {};
  switch (answer.state) {
    case 'acknowledged':
      return { state: 'acknowledged', afterMs: number(answer.after_ms) };
    case 'missing':
      return { state: 'missing' };
    case 'refused':
      return { state: 'refused', why: string(answer.why) };
    default:
      return { state: 'pending' };
  }
}

function readEvent(json: Json): SwarmEvent | null {
  const name = string(json.name);
  if (!name) return null;
  return {
    time: number(json.time_s) ?? 0,
    home: string(json.home),
    seq: number(json.seq) ?? 0,
    name,
    data: isRecord(json.data) ? json.data : {},
    requestedBy: strings(json.requested_by),
    blockedBy: strings(json.blocked_by),
    leaseAgeMs: number(json.lease_age_ms),
  };
}

function readWhy(json: Json): Why {
  const situation = isRecord(json.situation) ? json.situation : {};
  return {
    type: 'why',
    vehicle: string(json.vehicle),
    time: number(json.time_s) ?? 0,
    headline: string(json.headline),
    speed: number(situation.speed_m_s),
    stillSince: number(situation.still_since_s),
    requests: list(json.requests, readRequested),
    changes: list(json.changes, ({ because, needed, cycle }) => ({
      because: strings(because),
      needed: strings(needed),
      cycle: strings(cycle),
    })),
    events: list(json.events, readPastEvent),
    doubts: strings(json.doubts),
  };
}

function readRequested(json: Json): Requested | null {
  const event = string(json.event);
  if (!event) return null;
  return {
    event,
    by: string(json.by),
    priority: number(json.priority),
    blockedBy: list(json.blocked_by, (blocker) => ({
      node: string(blocker.node),
      bthread: string(blocker.bthread),
      local: blocker.local === true,
      leaseAge: number(blocker.lease_age_s),
      lease: number(blocker.lease_s),
    })),
  };
}

function readPastEvent(json: Json): PastEvent | null {
  const event = string(json.event);
  if (!event) return null;
  return { time: number(json.time_s) ?? 0, event, requestedBy: strings(json.requested_by), choice: string(json.choice) };
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
