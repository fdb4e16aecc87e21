/**
 * A vehicle's badge: its number on its shape in its colour, the same in every place it appears.
 */

import { svg } from './dom';
import type { Identity, Shape } from './identity';

const OUTLINES: Record<Shape, string> = {
  circle: 'M10 1.2a8.8 8.8 0 1 1 0 17.6a8.8 8.8 0 1 1 0-17.6z',
  square: 'M3.6 2h12.8a1.6 1.6 0 0 1 1.6 1.6v12.8a1.6 1.6 0 0 1-1.6 1.6H3.6A1.6 1.6 0 0 1 2 16.4V3.6A1.6 1.6 0 0 1 3.6 2z',
  diamond: 'M10 0l10 10l-10 10L0 10z',
  hexagon: 'M5.2 1.4h9.6L19.6 10l-4.8 8.6H5.2L.4 10z',
  shield: 'M2 2h16v9.2L10 19.4L2 11.2z',
};

/** The badge is decoration: next to it stands the vehicle's name. */
export function badge({ number, colour, shape }: Identity): SVGSVGElement {
  const element = svg(
    'svg',
    { class: 'badge', viewBox: '0 0 20 20', 'aria-hidden': 'true' },
    svg('path', { d: OUTLINES[shape] }),
    svg('text', { x: '10', y: shape === 'shield' ? '12.6' : '13.8' }, String(number)),
  );
  element.style.setProperty('--colour', `var(--vehicle-${colour})`);
  return element;
}
