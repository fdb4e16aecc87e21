/**
 * The number that is typed digit by digit: vehicle 12 is `1` and `2`, one soon after the other.
 */

/** Who types the next digit later than this begins anew. */
const TOGETHER_MS = 800;

export class TypedNumber {
  private digits = '';
  private at = -Infinity;

  /** `exists` says whether there is a vehicle of a number. */
  constructor(private readonly exists: (number: number) => boolean) {}

  /** The number that this digit, typed at `now`, makes with those before it; none if there is no such vehicle. */
  type(digit: string, now: number): number | null {
    const longer = now - this.at < TOGETHER_MS ? this.digits + digit : digit;
    const digits = this.exists(Number(longer)) ? longer : digit;
    const known = this.exists(Number(digits));
    [this.digits, this.at] = known ? [digits, now] : ['', -Infinity];
    return known ? Number(digits) : null;
  }
}
