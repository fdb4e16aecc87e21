/**
 * Which vehicles the operator has picked out. None picked means that orders are for all.
 */

export class Selection {
  private readonly picked = new Set<string>();

  constructor(private readonly changed: () => void) {}

  get names(): ReadonlySet<string> {
    return this.picked;
  }

  has(name: string): boolean {
    return this.picked.has(name);
  }

  /** Picks `name` alone. */
  pick(name: string): void {
    this.set([name]);
  }

  /** Adds `name` to the picked, or takes it away. */
  toggle(name: string): void {
    if (!this.picked.delete(name)) this.picked.add(name);
    this.changed();
  }

  set(names: Iterable<string>): void {
    const next = [...names];
    if (next.length === this.picked.size && next.every((name) => this.picked.has(name))) return;
    this.picked.clear();
    next.forEach((name) => this.picked.add(name));
    this.changed();
  }

  /**
   * Whom an order is for. A picked vehicle that has left the fleet stays an addressee, which the station refuses: were
   * it dropped, an order meant for it alone would go to everyone.
   */
  addressees(fleet: readonly string[]): 'all' | string[] {
    if (this.picked.size === 0 || (fleet.length > 0 && fleet.every((name) => this.picked.has(name)))) return 'all';
    const gone = [...this.picked].filter((name) => !fleet.includes(name));
    return [...fleet.filter((name) => this.picked.has(name)), ...gone];
  }
}

/** Whom an order is for, in words. */
export function addresseeWords(to: 'all' | string[], fleet: number): string {
  if (to !== 'all') return to.join(', ');
  return fleet === 1 ? 'The only vehicle' : fleet === 0 ? 'All vehicles' : `All ${fleet} vehicles`;
}
