/**
 * The shape of a vehicle: a multirotor of radius 1 that looks along x, with a nose to show its heading.
 */

import { BoxGeometry, type BufferGeometry, Color, ConeGeometry, CylinderGeometry } from 'three';
import { mergeGeometries } from 'three/addons/utils/BufferGeometryUtils.js';
import type { Vec3, Vehicle } from '../protocol';
import type { Eye } from './eye';
import { mixed } from './palette';
import { shaded } from './shading';

/** However far away a vehicle is, its shape has at least this radius in pixels. */
const LEAST_RADIUS_PX = 11;

export function makeGlyph(colour: Color, noseColour: Color, fine: boolean): BufferGeometry {
  const sides = fine ? 20 : 6;
  const rotor = (x: number, y: number) => new CylinderGeometry(0.36, 0.36, 0.07, sides).rotateX(Math.PI / 2).translate(x, y, 0.14);
  const arm = (angle: number) => new BoxGeometry(1.45, 0.11, 0.09).rotateZ(angle);
  const body = new CylinderGeometry(0.3, 0.36, 0.26, fine ? 10 : 6).rotateX(Math.PI / 2).translate(0, 0, 0.03);
  const nose = new ConeGeometry(0.3, 0.85, fine ? 12 : 4).rotateZ(-Math.PI / 2).translate(0.72, 0, 0.08);
  const rotors = [rotor(0.55, 0.55), rotor(0.55, -0.55), rotor(-0.55, 0.55), rotor(-0.55, -0.55)];

  const part = (shapes: BufferGeometry[], lit: Color) => shaded(shapes, lit, mixed(lit, new Color(0x000000), 0.7), !fine);
  const frame = part([arm(Math.PI / 4), arm(-Math.PI / 4), body, ...rotors], colour);
  return mergeGeometries([frame, part([nose], noseColour)]);
}

/** Its hull's radius, or more if that would be too small to see. */
export function glyphRadius(vehicle: Vehicle, position: Vec3, eye: Eye): number {
  const seen = eye.project(position);
  const least = seen ? eye.metresPerPixel(seen.distance) * LEAST_RADIUS_PX : 0;
  return Math.max(vehicle.radius_m, least);
}
