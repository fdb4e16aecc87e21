/**
 * The colours of the live view. They are written once, in the style sheet; this reads the current theme's.
 */

import { Color } from 'three';
import { COLOURS } from '../identity';

export interface Palette {
  sky: Color;
  ground: Color;
  grid: Color;
  gridStrong: Color;
  bounds: Color;
  obstacleLit: Color;
  obstacleShade: Color;
  obstacleEdge: Color;
  shadow: Color;
  /** What a vehicle's colour turns into when its link is lost. */
  lost: Color;
  selected: Color;
  target: Color;
  /** Of zones that keep vehicles out, and in. */
  zoneOut: Color;
  zoneIn: Color;
  vehicles: Color[];
}

export function readPalette(): Palette {
  const style = getComputedStyle(document.documentElement);
  const colour = (name: string) => new Color(style.getPropertyValue(`--${name}`).trim() || '#808080');
  return {
    sky: colour('sky'),
    ground: colour('ground'),
    grid: colour('grid'),
    gridStrong: colour('grid-strong'),
    bounds: colour('bounds'),
    obstacleLit: colour('obstacle-lit'),
    obstacleShade: colour('obstacle-shade'),
    obstacleEdge: colour('obstacle-edge'),
    shadow: colour('shadow'),
    lost: colour('lost'),
    selected: colour('selected'),
    target: colour('target'),
    zoneOut: colour('zone-out'),
    zoneIn: colour('zone-in'),
    vehicles: Array.from({ length: COLOURS }, (_, i) => colour(`vehicle-${i}`)),
  };
}

/** `from` on the way to `to`: how everything here fades, since overlapping translucent lines would show their joints. */
export function mixed(from: Color, to: Color, amount: number): Color {
  return new Color().lerpColors(from, to, amount);
}
