/**
 * The live view: the world and the swarm in three dimensions, painted when something has changed.
 */

import { type Group, Scene as ThreeScene } from 'three';
import { html, setText } from '../dom';
import { type Identity, identities } from '../identity';
import type { Place } from '../drawing';
import type { Bounds, Fleet, Point, Scene, Vec3, Vehicle, Zone } from '../protocol';
import { dispose } from './dispose';
import { Eye } from './eye';
import { gridStep, makeGround } from './ground';
import { Instruments } from './instruments';
import { Labels, placeWords } from './labels';
import { makeObstacles } from './obstacles';
import { Pacing } from './pacing';
import { makePainter, type Painter } from './painter';
import { type Palette, readPalette } from './palette';
import { Pointing } from './pointing';
import { RouteLine } from './route-line';
import { Swarm } from './swarm';
import { Target } from './target';
import { Zones } from './zones';

/** A vehicle is hit by a click this near to it, in pixels. */
const REACH_PX = 20;
/** What is shown around the origin before anything is known. */
const NOWHERE: Bounds = { min: [-10, -10, 0], max: [10, 10, 4] };

export interface ViewEvents {
  /** A vehicle was clicked; `more` if it shall be added to those already selected. */
  picked(name: string, more: boolean): void;
  /** A place on the ground was clicked while placing. */
  placed(place: [x: number, y: number]): void;
}

export class View {
  private readonly painter: Painter;
  private readonly pacing: Pacing;
  private readonly eye: Eye;
  private readonly scene = new ThreeScene();
  private readonly swarm: Swarm;
  private readonly target: Target;
  private readonly zoneLines: Zones;
  private readonly routeLine: RouteLine;
  private readonly labels = new Labels();
  private readonly instruments = new Instruments();
  private readonly cursor = html('p', { class: 'cursor', 'aria-hidden': 'true' });
  private readonly size = { width: 1, height: 1 };
  private palette: Palette = readPalette();

  private world: Group[] = [];
  private bounds: Bounds | null = null;
  private obstacles: Scene['obstacles'] = [];
  private worldShown = '';
  private vehicles: Vehicle[] = [];
  private looks: ReadonlyMap<string, Identity> = new Map();
  private selected: ReadonlySet<string> = new Set();
  private goal: Point | null = null;
  private zones: readonly Zone[] = [];
  private drawn: readonly Place[] = [];
  private radius: number | null = null;
  private route: { vehicle: string; points: readonly Vec3[] } | null = null;
  private pointed: [x: number, y: number] | null = null;
  private placing = false;
  /** How much is known of where things are; each step from nothing fits the view once. */
  private fitted: 'nothing' | 'vehicles' | 'world' = 'nothing';

  constructor(
    private readonly container: HTMLElement,
    private readonly events: ViewEvents,
  ) {
    this.painter = makePainter();
    this.pacing = new Pacing(this.painter, () => this.paint());
    container.dataset.renderer = this.painter.kind;
    container.tabIndex = 0;
    container.setAttribute('role', 'application');
    container.setAttribute(
      'aria-label',
      'Map of the swarm in three dimensions. Drag to orbit, right drag or arrow keys to pan, wheel to zoom. The list of vehicles says the same in words.',
    );
    this.painter.element.setAttribute('class', 'picture');
    this.painter.element.setAttribute('aria-hidden', 'true');
    container.append(this.painter.element, this.labels.element, this.instruments.element, this.cursor);

    this.eye = new Eye(container, () => this.pacing.ask());
    this.swarm = new Swarm(this.painter.kind, this.palette);
    this.target = new Target(this.painter.kind);
    this.zoneLines = new Zones(this.painter.kind);
    this.routeLine = new RouteLine(this.painter.kind);
    this.scene.add(this.swarm.object, this.target.object, this.zoneLines.object, this.routeLine.object);
    new Pointing(container, {
      clicked: (x, y, more) => this.click(x, y, more),
      hovered: (x, y) => this.hover(x, y),
      left: () => this.hover(-1, -1),
    });
    new ResizeObserver(() => this.resize()).observe(container);
    this.build();
    this.resize();
    this.fit();
  }

  setScene(scene: Scene): void {
    const shown = JSON.stringify([scene.bounds, scene.obstacles]);
    if (shown === this.worldShown) return;
    this.worldShown = shown;
    this.bounds = scene.bounds;
    this.obstacles = scene.obstacles;
    this.build();
    this.showZones();
    if (this.fitted !== 'world' && (this.bounds || this.obstacles.length > 0)) {
      this.fitted = 'world';
      this.fit();
    }
    this.pacing.ask();
  }

  setFleet(fleet: Fleet): void {
    const names = fleet.vehicles.map(({ name }) => name);
    if (names.length !== this.looks.size || names.some((name) => !this.looks.has(name))) this.looks = identities(names);
    this.vehicles = fleet.vehicles;
    this.swarm.record(fleet.time_s, fleet.vehicles);
    if (this.fitted === 'nothing' && this.vehicles.some(({ position }) => position)) {
      this.fitted = 'vehicles';
      this.build();
      this.fit();
    }
    this.pacing.ask();
  }

  setSelection(selected: ReadonlySet<string>): void {
    this.selected = selected;
    this.pacing.ask();
  }

  setZones(zones: readonly Zone[]): void {
    this.zones = zones;
    this.showZones();
  }

  /** The corners of a zone that is being drawn, or its middle and its radius. */
  setDrawn(drawn: readonly Place[], radius: number | null): void {
    this.drawn = drawn;
    this.radius = radius;
    this.showZones();
  }

  /** The points of a route that is being drawn for a vehicle; `null` if none is. */
  setRoute(route: { vehicle: string; points: readonly Vec3[] } | null): void {
    this.route = route;
    this.pacing.ask();
  }

  /** What is drawn leads on from where its vehicle is; of those that are selected, what they have told is dashed. */
  private showRoutes(): void {
    const drawn = this.route;
    const from = this.vehicles.find(({ name }) => name === drawn?.vehicle)?.position ?? null;
    const told = this.vehicles.flatMap(({ name, position, way, armed }) => (position && armed && this.selected.has(name) && name !== drawn?.vehicle ? [[position, ...way]] : []));
    this.routeLine.show(drawn?.points ?? [], from, told, this.groundZ, this.palette);
  }

  private showZones(): void {
    const { min, max } = this.area();
    this.zoneLines.show(this.zones, this.drawn, this.radius, [min[2], max[2]], this.palette);
    this.pacing.ask();
  }

  /** The place of the last go-to. */
  setGoal(goal: Point | null): void {
    this.goal = goal;
    this.pacing.ask();
  }

  /** Whether clicks place a go-to instead of selecting. */
  setPlacing(placing: boolean): void {
    this.placing = placing;
    this.container.classList.toggle('placing', placing);
    this.pacing.ask();
  }

  /** Whether a place is one where a vehicle could be sent. */
  isWithin([x, y]: [x: number, y: number]): boolean {
    if (!this.bounds) return true;
    const { min, max } = this.bounds;
    return x >= min[0] && x <= max[0] && y >= min[1] && y <= max[1];
  }

  get groundZ(): number {
    return this.bounds?.min[2] ?? 0;
  }

  repaint(): void {
    this.palette = readPalette();
    this.swarm.repaint(this.palette);
    this.build();
    this.showZones();
    this.pacing.ask();
  }

  fit(): void {
    const area = this.area();
    // Air above what stands there would only make everything smaller.
    const tops = [...this.obstacles.map(topOf), ...this.vehicles.flatMap(({ position }) => (position ? [position[2]] : []))];
    const top = Math.min(area.max[2], Math.max(area.min[2] + 1, ...tops));
    this.eye.fit({ min: area.min, max: [area.max[0], area.max[1], top] });
    this.pacing.ask();
  }

  /** All that is known to be anywhere. */
  private area(): Bounds {
    if (this.bounds) return this.bounds;
    const places = [...this.obstacles, ...this.vehicles].flatMap(({ position }) => (position ? [position] : []));
    if (places.length === 0) return NOWHERE;
    const edge = (pick: (...values: number[]) => number, axis: 0 | 1 | 2, room: number) => pick(...places.map((at) => at[axis])) + room;
    return {
      min: [edge(Math.min, 0, -5), edge(Math.min, 1, -5), 0],
      max: [edge(Math.max, 0, 5), edge(Math.max, 1, 5), edge(Math.max, 2, 3)],
    };
  }

  /** Ground and obstacles, which change seldom. */
  private build(): void {
    for (const group of this.world) {
      this.scene.remove(group);
      dispose(group);
    }
    this.scene.background = this.palette.sky;
    this.world = [
      makeGround(this.painter.kind, this.area(), this.bounds, this.palette),
      makeObstacles(this.painter.kind, this.obstacles, this.palette),
    ];
    this.scene.add(...this.world);
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.container;
    if (width === 0 || height === 0) return;
    const first = this.size.width === 1;
    Object.assign(this.size, { width, height });
    this.painter.resize(width, height);
    this.eye.resize(width, height);
    if (first) this.fit();
    this.pacing.ask();
  }

  private paint(): void {
    const { eye, groundZ } = this;
    eye.camera.updateMatrixWorld();
    this.swarm.show(this.vehicles, this.looks, this.selected, eye, groundZ);
    const target: Point | null = this.placing && this.pointed ? [...this.pointed, null] : this.goal;
    this.target.show(target, eye, groundZ, this.palette);
    this.showRoutes();
    this.painter.paint(this.scene, eye.camera);
    this.labels.show(this.vehicles, this.looks, this.selected, eye, groundZ);
    this.labels.showTarget(this.placing ? null : this.goal, eye, groundZ);
    const { min, max } = this.area();
    this.instruments.update(eye, gridStep(Math.max(max[0] - min[0], max[1] - min[1])));
  }

  private click(x: number, y: number, more: boolean): void {
    if (this.placing) {
      const place = this.eye.groundAt(x, y, this.groundZ);
      if (place) this.events.placed(place);
      return;
    }
    const name = this.vehicleAt(x, y);
    if (name) this.events.picked(name, more);
  }

  private hover(x: number, y: number): void {
    const inside = x >= 0 && y >= 0;
    this.pointed = inside ? this.eye.groundAt(x, y, this.groundZ) : null;
    this.container.classList.toggle('over-vehicle', inside && !this.placing && this.vehicleAt(x, y) !== null);
    setText(this.cursor, this.pointed && this.isWithin(this.pointed) ? placeWords(...this.pointed) : '');
    if (this.placing) {
      this.container.classList.toggle('outside', this.pointed !== null && !this.isWithin(this.pointed));
      this.pacing.ask();
    }
  }

  private vehicleAt(x: number, y: number): string | null {
    const near = this.vehicles.flatMap(({ name, position }) => {
      const place = position && this.eye.project(position);
      return place ? [{ name, distance: Math.hypot(place.x - x, place.y - y) }] : [];
    });
    near.sort((a, b) => a.distance - b.distance);
    const nearest = near[0];
    return nearest && nearest.distance <= REACH_PX ? nearest.name : this.labels.at(x, y);
  }
}

function topOf(obstacle: Scene['obstacles'][number]): number {
  const reach: Vec3 = obstacle.form === 'box' ? obstacle.size : [0, 0, obstacle.form === 'cylinder' ? obstacle.height : 2 * obstacle.radius];
  return obstacle.position[2] + reach[2] / 2;
}
