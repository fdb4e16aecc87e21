/**
 * Station and console say these to each other. Made from the station's types in `ground/src`; to make it anew:
 *
 *     SKEIN_REFRESH=1 cargo test -p skein-ground --lib typescript
 */

import type { What } from './vocabulary';
import type { ZoneTable } from './zone';

export type AnswerView = { "state": "pending" } | { "state": "missing" } | { "state": "acknowledged", after_ms: number, } | { "state": "refused", why: string, };

/**
 * A b-thread that blocks a request.
 */
export type Blocker = { node: string, bthread: string,
/**
 * Whether it runs where it blocks.
 */
local: boolean,
/**
 * The time since it renewed its block, if that comes from elsewhere.
 */
lease_age_s: number | null,
/**
 * After what age the block lapses.
 */
lease_s: number | null, };

export type Bounds = { min: [number, number, number], max: [number, number, number], };

export type CandidateView = { name: string, task: string,
/**
 * The checks before take-off that do not pass.
 */
doubts: Array<string>, };

/**
 * One reason for which a vehicle stands still, and what would end it.
 */
export type Change = {
/**
 * Sentences, from the vehicle to what is behind it all.
 */
because: Array<string>,
/**
 * Any of these would end it. Empty if nothing known would.
 */
needed: Array<string>,
/**
 * The b-threads that wait for one another in a ring, if that is the reason.
 */
cycle: Array<string>, };

export type CheckView = { name: string,
/**
 * `passes`, `fails` or `waits`.
 */
state: string, value: string, advice: string, };

/**
 * A message of a browser.
 */
export type ClientMessage = { "type": "hello", tag: string | null, name: string, } | { "type": "order" } & OrderMessage | { "type": "draw", tag: string | null, zone: ZoneTable, } | { "type": "erase", tag: string | null, name: string, } | { "type": "replay" } & ReplayMessage | { "type": "why", vehicle: string | null, } | { "type": "read_script", tag: string | null, file: string, text: string, } | { "type": "plan", tag: string | null, to: To, targets: Array<[number, number, number]>, } | { "type": "rehearse", tag: string | null,
/**
 * Points (ENU, metres) by vehicle.
 */
routes: Record<string, [number, number, number][]>,
/**
 * It is flown so often, with other gusts and errors each time: 1 to 10.
 */
flights?: number, };

/**
 * A route's cost, and what it is made of before that is weighed.
 */
export type CostView = { cost_m: number, length_m: number,
/**
 * At cruise.
 */
time_s: number, height_m: number, repulsion_m: number,
/**
 * Share of what is in the battery.
 */
energy: number, turning: number, };

/**
 * Two vehicles that would come nearer to one another than a plan keeps.
 */
export type Encounter = { who: [string, string],
/**
 * After the vehicles have set out, s.
 */
at_s: number, distance_m: number,
/**
 * ENU, metres.
 */
place: [number, number, number], };

/**
 * An event that has happened.
 */
export type EventNote = { time_s: number,
/**
 * Its name and data.
 */
event: string,
/**
 * Where it was decided.
 */
home: string,
/**
 * The b-threads that requested it; none if the node reports it.
 */
requested_by: Array<string>,
/**
 * At which priority, and which requests it went before.
 */
choice: string | null, };

export type EventView = { time_s: number, home: string, seq: number, name: string, data: Record<string, unknown>, requested_by: Array<string>, blocked_by: Array<string>, };

export type Failure = { why: string, seeds: number, };

export type JourneyView = { vehicle: string,
/**
 * The numbers of its targets, from 1.
 */
targets: Array<number>,
/**
 * The points to send it as its route, metres ENU.
 */
points: Array<[number, number, number]>,
/**
 * The numbers, from 0, of those that it is to reach whatever comes: to be sent with them.
 */
stops: Array<number>, by: Method, cost: CostView, second: SecondView | null,
/**
 * Factor by which it flies slower than at cruise.
 */
slowed: number, };

export type LinkView = { alive: boolean, age_ms: number | null, };

/**
 * A planner of routes. Both have the same cost.
 */
export type Method = "swarm" | "lattice";

export type MissionView = "under_way" | "complete" | "failed";

/**
 * Two vehicles at the moment at which they are nearest.
 */
export type Nearness = { who: [string, string],
/**
 * Centre to centre.
 */
distance_m: number, at_s: number, seed: number, };

/**
 * Something that stands in the world: its form, and where its middle is (ENU, metres; a quaternion x, y, z, w).
 */
export type Obstacle = { position: [number, number, number], orientation: [number, number, number, number], } & ({ "form": "box", size: [number, number, number], } | { "form": "cylinder", radius: number, height: number, } | { "form": "sphere", radius: number, });

export type OrderMessage = { tag?: string, what: What, to: To, point?: [number, number, number | null],
/**
 * For `route`: the points, metres ENU.
 */
points?: Array<[number, number, number]>,
/**
 * The numbers, from 0, of the points that are targets, if the others are only the way there.
 */
stops?: Array<number>,
/**
 * For `load`: a script with values for its parameters.
 */
script?: { script: unknown, with: Record<string, unknown> },
/**
 * For `unload`: the name that the script runs under. For `give`: to whom.
 */
name?: string,
/**
 * For a launch: the token that the first message was answered with.
 */
token?: string, };

export type OrderView = { id: number, by: string, what: string, script: string | null, time_s: number, answers: { [key in string]: AnswerView }, };

export type OutcomeView = { succeeded: boolean, failed: { [key in string]: string }, };

/**
 * The end of a vehicle's flights.
 */
export type Played = { vehicle: string,
/**
 * With how many seeds it arrives.
 */
arrives: number,
/**
 * When it has landed, wherever.
 */
lands_s?: Range,
/**
 * Share of its battery's energy that is left then, 0 to 1.
 */
battery?: Range,
/**
 * Its waits, and how long they last with each seed on average, the longest first.
 */
waits: Array<Wait>,
/**
 * Why it does not arrive, and with how many seeds.
 */
fails: Array<Failure>, };

/**
 * The least and the greatest of some numbers, and their mean.
 */
export type Range = { least: number, mean: number, most: number, };

/**
 * The outcome of a rehearsal. Times are seconds since the vehicles in the air set out, or since the beginning if none is.
 */
export type Rehearsed = {
/**
 * The seeds that it was flown with.
 */
seeds: number[],
/**
 * With every seed every vehicle arrives that is not held, and nothing collides.
 */
succeeded: boolean, vehicles: Array<Played>,
/**
 * When the last has landed, of those seeds with which all ended in time.
 */
ends_s?: Range,
/**
 * The pairs of vehicles that come nearest to one another in the air, the nearest first; of each pair one moment.
 */
nearest: Array<Nearness>,
/**
 * The least distance from a hull to an obstacle; none where there are none.
 */
clearance_m?: number,
/**
 * Collisions with obstacles and between vehicles, with all seeds.
 */
collisions: [number, number],
/**
 * Simulated time of all flights over the time that it took.
 */
realtime_factor: number,
/**
 * Notes on what was left out.
 */
notes: Array<string>, };

/**
 * A change in how a recording is played.
 */
export type ReplayMessage = { tag?: string,
/**
 * Whether it is to play.
 */
play?: boolean,
/**
 * Where to go to.
 */
at_s?: number,
/**
 * The factor by which it is to play faster.
 */
speed?: number, };

/**
 * Something that is requested.
 */
export type Request = {
/**
 * Its name and data.
 */
event: string, by: string,
/**
 * At which priority.
 */
priority: number | null,
/**
 * The b-threads that block it at its home.
 */
blocked_by: Array<Blocker>, };

/**
 * The rights of a person or program at the console.
 */
export type Role = "observer" | "safety" | "operator";

export type SecondView = { by: Method, cost: CostView, points: Array<[number, number, number]>, };

/**
 * A message for browsers.
 */
export type ServerMessage = { "type": "scene", fleet: string, station: string, software: string,
/**
 * The file in which the mission is recorded; empty if it is not.
 */
recording: string, bounds: Bounds | null, obstacles: Array<Obstacle>, } | { "type": "fleet", time_s: number, outcome: OutcomeView | null, vehicles: Array<VehicleView>, } | { "type": "orders", orders: Array<OrderView>, } | { "type": "events", events: Array<EventView>,
/**
 * Whether all that was told before is void.
 */
anew: boolean, } | { "type": "replay", at_s: number, from_s: number, to_s: number, playing: boolean, speed: number,
/**
 * Whether it was brought to its end, and not cut short.
 */
complete: boolean, } | { "type": "zones", zones: Array<ZoneView>, } | { "type": "why", headline: string, vehicle: string, time_s: number,
/**
 * Where it is and what it does; none of one that has not been heard.
 */
situation: Situation | null,
/**
 * Its latest events, newest first.
 */
events: Array<EventNote>,
/**
 * The requests for its events now, by its own b-threads and by others.
 */
requests: Array<Request>,
/**
 * The limits on its motion, and whose they are.
 */
limits: Array<string>,
/**
 * The changes that would let it move: one will do. Empty while it moves.
 */
changes: Array<Change>,
/**
 * The doubts about all this.
 */
doubts: Array<string>, } | { "type": "you", tag: string | null, name: string | null, role: Role,
/**
 * Whether a certificate says so; otherwise whoever sits there does.
 */
certified: boolean, } | { "type": "offer", tag: string | null, token: string, what: string, lasts_s: number, vehicles: Array<CandidateView>, } | { "type": "ordered", tag: string | null, id: number, } | { "type": "plan", tag: string | null, journeys: Array<JourneyView>,
/**
 * The vehicles that no route was made for, and why.
 */
left_out: { [key in string]: string },
/**
 * When all arrive, seconds after they have set out.
 */
arrival_s: number, cost_m: number,
/**
 * The pairs that would come too near: a plan with any is not to be sent.
 */
encounters: Array<Encounter>, } | { "type": "rehearsed", tag: string | null, rehearsed: Rehearsed, left_out: Record<string, string>, } | { "type": "mapped", tag: string | null, name: string, } | { "type": "replayed", tag: string | null, } | { "type": "script", tag: string | null, script: unknown, } | { "type": "error", tag: string | null, message: string, };

/**
 * Where a vehicle is and what it does.
 */
export type Situation = {
/**
 * The age of this.
 */
age_s: number,
/**
 * The autopilot's mode.
 */
mode: string,
/**
 * The vehicle's task, as it says.
 */
task: string,
/**
 * Whether its motors are armed.
 */
armed: boolean,
/**
 * `under_way`, `complete` or `failed`.
 */
mission: string,
/**
 * ENU, metres.
 */
position: [number, number, number],
/**
 * Metres per second.
 */
speed_m_s: number,
/**
 * Since when it has not left this place; none if it moves.
 */
still_since_s: number | null, };

export type StateView = { position: [number, number, number], velocity: [number, number, number], yaw_rad: number, radius_m: number, mode: string, armed: boolean, battery: number, task: string, waiting_for: string, mission: MissionView, path: Array<[number, number, number]>, scripts: Array<string>,
/**
 * The names of the zones that it has regard for.
 */
zones: Array<string>,
/**
 * The person or program whose orders it takes; empty while nobody holds it.
 */
holder: string,
/**
 * The person or program that asks the holder for it; empty if nobody does.
 */
asked_by: string, };

export type To = string | Array<string>;

export type VehicleView = { name: string, heard: boolean, link: LinkView, notes: Array<string>,
/**
 * Its checks before take-off.
 */
checks: Array<CheckView>,
/**
 * The points that it still has to fly, as far as it has told (ENU, metres).
 */
way: Array<[number, number, number]>, };

export type Wait = {
/**
 * As the vehicle says it.
 */
waits_for: string, mean_s: number, };

export type ZoneView = { zone: ZoneTable, by: string, time_s: number,
/**
 * Whether it is being removed; then a vehicle acknowledges that it has let it go.
 */
going: boolean, answers: { [key in string]: AnswerView }, };
