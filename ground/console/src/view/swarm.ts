/**
 * The vehicles in the view: their shapes, the stems that show how high they are, trails, planned paths and rings around
 * the selected.
 */

import { CircleGeometry, type Color, GreaterDepth, Group, Mesh, MeshBasicMaterial } from 'three';
import type { Identity } from '../identity';
import type { Vec3, Vehicle } from '../protocol';
import { dispose } from './dispose';
import type { Eye } from './eye';
import { glyphRadius, makeGlyph } from './glyph';
import { GROUND_ORDER } from './ground';
import type { Painter } from './painter';
import { mixed, type Palette } from './palette';
import { circle, dashes, makeStrokes, polyline } from './strokes';
import { Trails } from './trails';

/** A trail fades in so many steps: the SVG painter needs an object for each. */
const FADES = 6;

interface Body {
  group: Group;
  shape: Mesh;
  ghost: Mesh;
  shadow: Mesh;
  colour: Color;
}

export class Swarm {
  readonly object = new Group();
  private readonly trails = new Trails();
  private readonly bodies = new Map<string, Body>();
  private readonly trailStrokes;
  private readonly pathStrokes;
  private readonly stemStrokes;
  private readonly ringStrokes;

  constructor(
    private readonly kind: Painter['kind'],
    private palette: Palette,
  ) {
    this.trailStrokes = makeStrokes(kind, { width: 2, order: 2 });
    this.pathStrokes = makeStrokes(kind, { width: 1.5, order: 2 });
    this.stemStrokes = makeStrokes(kind, { width: 1, order: 2 });
    this.ringStrokes = makeStrokes(kind, { width: 2, order: 4 });
    const strokes = [this.trailStrokes, this.pathStrokes, this.stemStrokes, this.ringStrokes];
    this.object.add(...strokes.map((each) => each.object));
  }

  /** Colours have changed: shapes are made anew when they are next shown. */
  repaint(palette: Palette): void {
    this.palette = palette;
    for (const name of [...this.bodies.keys()]) this.remove(name);
  }

  /** What trails are made of; called for each message, painted or not. */
  record(time: number, vehicles: readonly Vehicle[]): void {
    this.trails.advance(time);
    for (const { name, position } of vehicles) if (position) this.trails.add(name, position);
  }

  show(
    vehicles: readonly Vehicle[],
    looks: ReadonlyMap<string, Identity>,
    selected: ReadonlySet<string>,
    eye: Eye,
    groundZ: number,
  ): void {
    const strokes = [this.trailStrokes, this.pathStrokes, this.stemStrokes, this.ringStrokes];
    strokes.forEach((each) => each.clear());
    for (const name of [...this.bodies.keys()]) {
      if (!vehicles.some((vehicle) => vehicle.name === name && vehicle.position)) this.remove(name);
    }
    for (const vehicle of vehicles) {
      const look = looks.get(vehicle.name);
      if (!vehicle.position || !look) continue;
      const own = this.palette.vehicles[look.colour] ?? this.palette.selected;
      const colour = vehicle.link.alive ? own : this.palette.lost;
      const radius = glyphRadius(vehicle, vehicle.position, eye);
      this.place(vehicle, vehicle.position, colour, radius, groundZ);
      this.trail(vehicle, vehicle.position, own);
      this.plan(vehicle, mixed(this.palette.ground, colour, 0.75), radius);
      if (selected.has(vehicle.name)) this.ring(vehicle.position, radius, groundZ);
    }
    strokes.forEach((each) => each.done());
  }

  private place(vehicle: Vehicle, [x, y, z]: Vec3, colour: Color, radius: number, groundZ: number): void {
    const body = this.body(vehicle.name, colour);
    body.group.position.set(x, y, z);
    body.group.rotation.z = vehicle.yaw_rad ?? 0;
    body.group.scale.setScalar(radius);
    body.shadow.position.set(x, y, groundZ);
    body.shadow.scale.setScalar(radius * 0.62);
    if (z - groundZ > 0.1) this.stemStrokes.line([x, y, groundZ], [x, y, z], mixed(this.palette.ground, colour, 0.6));
  }

  private trail(vehicle: Vehicle, position: Vec3, colour: Color): void {
    const points = this.trails.of(vehicle.name);
    const shades = Array.from({ length: FADES }, (_, i) => mixed(this.palette.ground, colour, 0.1 + (0.7 * (i + 1)) / FADES));
    points.forEach((point, i) => {
      const shade = shades[Math.min(FADES - 1, Math.floor(this.trails.freshness(point) * FADES))]!;
      this.trailStrokes.line(point.at, points[i + 1]?.at ?? position, shade);
    });
  }

  /** The path ahead from where the vehicle is now, with a ring at its end. */
  private plan({ path }: Vehicle, colour: Color, radius: number): void {
    const end = path.at(-1);
    if (!end || path.length < 2) return;
    if (this.kind === 'webgl') dashes(this.pathStrokes, path, colour, radius * 0.4);
    else polyline(this.pathStrokes, path, colour);
    circle(this.pathStrokes, end, radius * 0.6, colour, 14);
  }

  private ring([x, y, z]: Vec3, radius: number, groundZ: number): void {
    circle(this.ringStrokes, [x, y, z], radius * 1.55, this.palette.selected);
    circle(this.ringStrokes, [x, y, groundZ], radius * 0.85, this.palette.selected, 20);
  }

  private body(name: string, colour: Color): Body {
    const known = this.bodies.get(name);
    if (known?.colour.equals(colour)) return known;
    if (known) this.remove(name);
    const fine = this.kind === 'webgl';
    const geometry = makeGlyph(colour, this.palette.selected, fine);
    const shape = new Mesh(geometry, new MeshBasicMaterial({ vertexColors: true }));
    shape.renderOrder = 5;
    // Behind an obstacle the vehicle shines through.
    const ghost = new Mesh(
      geometry,
      new MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.4, depthFunc: GreaterDepth, depthWrite: false }),
    );
    ghost.visible = fine;
    ghost.renderOrder = 4;
    const shadow = new Mesh(
      new CircleGeometry(1, fine ? 24 : 10),
      new MeshBasicMaterial({ color: this.palette.shadow, depthTest: false, depthWrite: false }),
    );
    shadow.renderOrder = GROUND_ORDER.shadows;
    const group = new Group().add(shape, ghost);
    const body = { group, shape, ghost, shadow, colour };
    this.bodies.set(name, body);
    this.object.add(group, shadow);
    return body;
  }

  private remove(name: string): void {
    const body = this.bodies.get(name);
    if (!body) return;
    this.bodies.delete(name);
    this.object.remove(body.group, body.shadow);
    dispose(body.group);
    dispose(body.shadow);
  }
}
