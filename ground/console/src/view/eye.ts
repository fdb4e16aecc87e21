/**
 * The operator's eye: a camera that orbits what it looks at, and knows how to fit the whole world in.
 */

import { type Camera, MathUtils, PerspectiveCamera, Plane, Raycaster, Vector2, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import type { Bounds, Vec3 } from '../protocol';

const FIELD_OF_VIEW = 26;
const ELEVATION = MathUtils.degToRad(58);
/** Room left around what is fitted in. */
const AIR = 1.04;

export class Eye {
  readonly camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.1, 5000);
  private readonly controls: OrbitControls;
  private readonly caster = new Raycaster();
  private width = 1;
  private height = 1;

  constructor(element: HTMLElement, moved: () => void) {
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(0, -40, 40);
    this.controls = new OrbitControls(this.camera, element);
    this.controls.zoomToCursor = true;
    this.controls.maxPolarAngle = MathUtils.degToRad(87);
    this.controls.minDistance = 2;
    this.controls.keyPanSpeed = 24;
    this.controls.listenToKeyEvents(element);
    this.controls.addEventListener('change', moved);
    // The style sheet says which cursor: it knows of modes.
    element.style.cursor = '';
  }

  resize(width: number, height: number): void {
    this.width = width;
    this.height = height;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  /** Looks down on `area` so that all of it is seen, as large as it can be. Its longer side lies across the view. */
  fit(area: Bounds): void {
    const { min, max } = area;
    const wide = max[0] - min[0] >= max[1] - min[1];
    const back = wide ? new Vector3(0, -1, 0) : new Vector3(1, 0, 0);
    back.multiplyScalar(Math.cos(ELEVATION)).setZ(Math.sin(ELEVATION));
    const target = new Vector3((min[0] + max[0]) / 2, (min[1] + max[1]) / 2, min[2]);

    const right = new Vector3(0, 0, 1).cross(back).normalize();
    const up = back.clone().cross(right);
    const tall = Math.tan(MathUtils.degToRad(FIELD_OF_VIEW) / 2);
    const corners = [min[0], max[0]].flatMap((x) => [min[1], max[1]].flatMap((y) => [min[2], max[2]].map((z) => new Vector3(x, y, z))));
    let distance = 4;
    // What is nearer looks larger, so the middle of the picture is not the middle of the area: look lower, twice.
    for (let round = 0; round < 3; round += 1) {
      const seen = corners.map((corner) => corner.clone().sub(target));
      const away = (point: Vector3) =>
        Math.max(Math.abs(point.dot(right)) / (tall * this.camera.aspect), Math.abs(point.dot(up)) / tall) * AIR + point.dot(back);
      distance = Math.max(4, ...seen.map(away));
      const heights = seen.map((point) => point.dot(up) / (distance - point.dot(back)));
      const middle = (Math.max(...heights) + Math.min(...heights)) / 2;
      target.addScaledVector(new Vector3(-back.x, -back.y, 0).normalize(), (middle * distance) / Math.sin(ELEVATION));
    }

    this.camera.position.copy(target).addScaledVector(back, distance);
    this.camera.near = Math.max(0.05, distance / 200);
    this.camera.far = distance * 20;
    this.camera.updateProjectionMatrix();
    this.controls.maxDistance = distance * 4;
    this.controls.target.copy(target);
    this.controls.update();
  }

  /** Where a world point appears, in pixels from the view's upper left; `null` behind the eye. */
  project([x, y, z]: Vec3): { x: number; y: number; distance: number } | null {
    const point = new Vector3(x, y, z);
    const distance = point.distanceTo(this.camera.position);
    point.project(this.camera as Camera);
    if (point.z > 1) return null;
    return { x: ((point.x + 1) / 2) * this.width, y: ((1 - point.y) / 2) * this.height, distance };
  }

  /** The place on the ground that appears at this pixel; `null` above the horizon. */
  groundAt(x: number, y: number, groundZ: number): [x: number, y: number] | null {
    this.caster.setFromCamera(new Vector2((x / this.width) * 2 - 1, 1 - (y / this.height) * 2), this.camera);
    const hit = this.caster.ray.intersectPlane(new Plane(new Vector3(0, 0, 1), -groundZ), new Vector3());
    return hit && [hit.x, hit.y];
  }

  /** How many metres a pixel is at this distance. */
  metresPerPixel(distance: number): number {
    return (2 * distance * Math.tan(MathUtils.degToRad(FIELD_OF_VIEW) / 2)) / this.height;
  }

  /** How far away is what it looks at. */
  get distance(): number {
    return this.controls.getDistance();
  }

  /** Where north is in the view: radians clockwise from up. */
  get north(): number {
    return this.controls.getAzimuthalAngle();
  }

  /** 1 looking straight down, towards 0 looking level. */
  get steepness(): number {
    return Math.cos(this.controls.getPolarAngle());
  }
}
