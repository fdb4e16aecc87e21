/**
 * Who holds vehicles: whose orders they take.
 */

import type { Vehicle } from './protocol';

/** Vehicles that one person or program holds; `holder` is empty if nobody does. */
export interface Holding {
  holder: string;
  vehicles: string[];
  /** Who asks the holder for some of them. */
  askers: string[];
}

/** Who holds which of these vehicles, each holder once, in the order of the vehicles. */
export function holdings(vehicles: readonly Pick<Vehicle, 'name' | 'holder' | 'asked_by'>[]): Holding[] {
  const byHolder = new Map<string, Holding>();
  for (const { name, holder, asked_by: asker } of vehicles) {
    const holding = byHolder.get(holder) ?? { holder, vehicles: [], askers: [] };
    holding.vehicles.push(name);
    if (asker && !holding.askers.includes(asker)) holding.askers.push(asker);
    byHolder.set(holder, holding);
  }
  return [...byHolder.values()];
}

/** What `me` must notice of a change: that somebody has taken a vehicle, asks for one, or gives one. */
export function holdingNews(before: Vehicle | undefined, now: Vehicle, me: string | null): string | null {
  if (!before || !me) return null;
  if (before.holder !== now.holder) {
    if (before.holder === me) return now.holder ? `${now.holder} commands ${now.name} now.` : `You command ${now.name} no more.`;
    if (now.holder === me && before.holder) return `You command ${now.name} now.`;
  }
  return now.holder === me && now.asked_by && now.asked_by !== before.asked_by ? `${now.asked_by} asks for ${now.name}.` : null;
}
