/**
 * Many straight lines drawn as one object: wide and round under WebGL if they shall be, else plain.
 *
 * Lines are given anew each time: `clear()`, any number of `line(...)`, `done()`. Colours are opaque.
 */

import {
  BufferAttribute,
  BufferGeometry,
  type Color,
  DynamicDrawUsage,
  Group,
  InstancedInterleavedBuffer,
  InterleavedBufferAttribute,
  LineBasicMaterial,
  LineSegments,
  type Object3D,
} from 'three';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import { LineSegments2 } from 'three/addons/lines/LineSegments2.js';
import { LineSegmentsGeometry } from 'three/addons/lines/LineSegmentsGeometry.js';
import type { Vec3 } from '../protocol';
import type { Painter } from './painter';

export interface Strokes {
  readonly object: Object3D;
  clear(): void;
  line(from: Vec3, to: Vec3, colour: Color): void;
  done(): void;
}

export interface StrokeStyle {
  /** Width in pixels. */
  width: number;
  /** Smaller is painted earlier. */
  order: number;
  /** Painted over whatever came before, however near that is. */
  flat?: boolean;
}

export function makeStrokes(kind: Painter['kind'], style: StrokeStyle): Strokes {
  // WebGL's own lines are one pixel wide, whatever one asks for, and many times cheaper than wide ones.
  return kind === 'webgl' && style.width > 1 ? new WideStrokes(style) : new PlainStrokes(style);
}

/** A polyline. */
export function polyline(strokes: Strokes, points: readonly Vec3[], colour: Color): void {
  for (let i = 1; i < points.length; i += 1) strokes.line(points[i - 1]!, points[i]!, colour);
}

/** A polyline of dashes of `dash` metres with gaps as long. */
export function dashes(strokes: Strokes, points: readonly Vec3[], colour: Color, dash: number): void {
  let along = 0;
  for (let i = 1; i < points.length; i += 1) {
    const [from, to] = [points[i - 1]!, points[i]!];
    const length = Math.hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
    if (length === 0) continue;
    const at = (distance: number): Vec3 => between(from, to, Math.min(1, Math.max(0, distance / length)));
    const first = Math.floor(along / (2 * dash));
    const last = Math.floor((along + length) / (2 * dash));
    for (let n = first; n <= last; n += 1) {
      const [start, end] = [n * 2 * dash - along, (n * 2 + 1) * dash - along];
      if (end > 0 && start < length) strokes.line(at(start), at(end), colour);
    }
    along += length;
  }
}

/** A level circle. */
export function circle(strokes: Strokes, centre: Vec3, radius: number, colour: Color, sides = 28): void {
  const corner = (i: number): Vec3 => {
    const angle = (2 * Math.PI * i) / sides;
    return [centre[0] + radius * Math.cos(angle), centre[1] + radius * Math.sin(angle), centre[2]];
  };
  for (let i = 0; i < sides; i += 1) strokes.line(corner(i), corner(i + 1), colour);
}

export function between(from: Vec3, to: Vec3, part: number): Vec3 {
  return [from[0] + (to[0] - from[0]) * part, from[1] + (to[1] - from[1]) * part, from[2] + (to[2] - from[2]) * part];
}

class WideStrokes implements Strokes {
  readonly object: LineSegments2;
  private places = new Float32Array(6 * 64);
  private colours = new Float32Array(6 * 64);
  private count = 0;
  private buffers: InstancedInterleavedBuffer[] = [];

  constructor(style: StrokeStyle) {
    const material = new LineMaterial({ linewidth: style.width, vertexColors: true });
    if (style.flat) {
      material.depthTest = false;
      material.depthWrite = false;
    }
    this.object = new LineSegments2(new LineSegmentsGeometry(), material);
    this.object.frustumCulled = false;
    this.object.renderOrder = style.order;
    this.allocate();
    this.done();
  }

  clear(): void {
    this.count = 0;
  }

  line(from: Vec3, to: Vec3, { r, g, b }: Color): void {
    const at = this.count * 6;
    if (at === this.places.length) this.grow();
    this.places.set([...from, ...to], at);
    this.colours.set([r, g, b, r, g, b], at);
    this.count += 1;
  }

  done(): void {
    this.object.visible = this.count > 0;
    this.object.geometry.instanceCount = this.count;
    for (const buffer of this.buffers) buffer.needsUpdate = true;
  }

  private grow(): void {
    const [places, colours] = [this.places, this.colours];
    this.places = new Float32Array(places.length * 2);
    this.colours = new Float32Array(colours.length * 2);
    this.places.set(places);
    this.colours.set(colours);
    this.allocate();
  }

  /** A buffer on the graphics card cannot grow, so a larger geometry takes its place. */
  private allocate(): void {
    this.object.geometry.dispose();
    const geometry = new LineSegmentsGeometry();
    this.buffers = [this.places, this.colours].map((array) =>
      new InstancedInterleavedBuffer(array, 6, 1).setUsage(DynamicDrawUsage),
    ) as InstancedInterleavedBuffer[];
    const [places, colours] = this.buffers;
    geometry.setAttribute('instanceStart', new InterleavedBufferAttribute(places!, 3, 0));
    geometry.setAttribute('instanceEnd', new InterleavedBufferAttribute(places!, 3, 3));
    geometry.setAttribute('instanceColorStart', new InterleavedBufferAttribute(colours!, 3, 0));
    geometry.setAttribute('instanceColorEnd', new InterleavedBufferAttribute(colours!, 3, 3));
    this.object.geometry = geometry;
  }
}

/** Lines of a colour are an object, for the SVG painter knows one colour per object. */
class PlainStrokes implements Strokes {
  readonly object = new Group();
  private readonly byColour = new Map<string, { lines: LineSegments<BufferGeometry, LineBasicMaterial>; places: number[] }>();

  constructor(private readonly style: StrokeStyle) {}

  clear(): void {
    for (const each of this.byColour.values()) each.places.length = 0;
  }

  line(from: Vec3, to: Vec3, colour: Color): void {
    const key = colour.getHexString();
    let each = this.byColour.get(key);
    if (!each) {
      const depth = this.style.flat ? { depthTest: false, depthWrite: false } : {};
      const material = new LineBasicMaterial({ color: colour.clone(), linewidth: this.style.width, ...depth });
      each = { lines: new LineSegments(new BufferGeometry(), material), places: [] };
      each.lines.frustumCulled = false;
      each.lines.renderOrder = this.style.order;
      this.byColour.set(key, each);
      this.object.add(each.lines);
    }
    each.places.push(...from, ...to);
  }

  done(): void {
    for (const [key, { lines, places }] of this.byColour) {
      if (places.length === 0) {
        this.object.remove(lines);
        lines.geometry.dispose();
        lines.material.dispose();
        this.byColour.delete(key);
      } else {
        const attribute = lines.geometry.getAttribute('position');
        if (attribute?.array.length === places.length) {
          (attribute as BufferAttribute).set(places).needsUpdate = true;
        } else {
          // Neither painter takes fewer lines than there are places.
          lines.geometry.dispose();
          lines.geometry.setAttribute('position', new BufferAttribute(new Float32Array(places), 3));
        }
      }
    }
  }
}
