/**
 * The words of orders, from the catalogue of events (protocol/wire/src/event). Do not edit: a test of skein-wire writes it.
 */

export const What = {
  launch: 'launch',
  launchTogether: 'launch_together',
  hold: 'hold',
  resume: 'resume',
  land: 'land',
  return: 'return',
  abort: 'abort',
  goto: 'goto',
  route: 'route',
  handBack: 'hand_back',
  load: 'load',
  unload: 'unload',
  ask: 'ask',
  give: 'give',
  take: 'take',
  release: 'release',
  keep: 'keep',
} as const;
export type What = (typeof What)[keyof typeof What];

/** What is drawn on the map. */
export const ZoneKind = {
  noFly: 'no_fly',
  stayInside: 'stay_inside',
  threat: 'threat',
  notAbove: 'not_above',
  notBelow: 'not_below',
  rally: 'rally',
} as const;
export type ZoneKind = (typeof ZoneKind)[keyof typeof ZoneKind];

/** These are decided for everyone, whoever is selected. */
export const FOR_ALL: ReadonlySet<What> = new Set([What.launch, What.launchTogether, What.abort]);

/** These bring vehicles to a stop, home, or down. */
export const FOR_SAFETY: ReadonlySet<What> = new Set([What.hold, What.land, What.return, What.abort]);
