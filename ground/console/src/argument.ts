/**
 * The values of a script's parameters, as an operator types them.
 */

import type { Argument, Parameter, Vec3 } from './protocol';

/** What was typed, as a value of this kind; `null` if it is none. */
export function argument(kind: Parameter['kind'], text: string): Argument | null {
  const trimmed = text.trim();
  switch (kind) {
    case 'number':
    case 'integer': {
      const value = trimmed === '' ? Number.NaN : Number(trimmed);
      return Number.isFinite(value) && (kind === 'number' || Number.isInteger(value)) ? value : null;
    }
    case 'node':
      return /^[\w-]+\/[\w-]+$/.test(trimmed) ? trimmed : null;
    case 'point':
      return point(trimmed);
    case 'route': {
      const points = trimmed.split('\n').filter((line) => line.trim()).map(point);
      return points.length > 0 && points.every((each) => each !== null) ? points : null;
    }
  }
}

/** The inverse: a value as it is typed. */
export function argumentText(value: Argument): string {
  if (!Array.isArray(value)) return String(value);
  return value.some(Array.isArray) ? value.map((each) => argumentText(each as Vec3)).join('\n') : value.join(', ');
}

/** `1, -2.5, 3`, with commas or spaces between. */
function point(text: string): Vec3 | null {
  const numbers = text.split(/[\s,]+/).filter(Boolean).map(Number);
  const [x, y, z] = numbers;
  return numbers.length === 3 && numbers.every(Number.isFinite) ? [x!, y!, z!] : null;
}
