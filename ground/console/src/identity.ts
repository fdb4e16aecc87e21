/**
 * How a vehicle is told from the others: a number, a colour and a shape. The number alone suffices; colour and shape
 * only make it quicker.
 */

export const COLOURS = 8;
export const SHAPES = ['circle', 'square', 'diamond', 'hexagon', 'shield'] as const;
export type Shape = (typeof SHAPES)[number];

export interface Identity {
  number: number;
  /** Index into the palette, which differs between the themes. */
  colour: number;
  shape: Shape;
}

/** Identities of the vehicles by name: each has the number in its name, or its place in the list if those clash. */
export function identities(names: readonly string[]): Map<string, Identity> {
  const inNames = names.map((name) => Number(/(\d{1,3})$/.exec(name)?.[1] ?? 0));
  const distinct = new Set(inNames).size === names.length && inNames.every((number) => number > 0);
  return new Map(names.map((name, place) => [name, identity((distinct && inNames[place]) || place + 1)]));
}

/** As eight colours and five shapes have no common divisor, forty vehicles differ. */
function identity(number: number): Identity {
  const place = number - 1;
  return { number, colour: place % COLOURS, shape: SHAPES[place % SHAPES.length] ?? 'circle' };
}
