/**
 * Draws a scene as SVG, from three.js' own projection of it. Three.js' SVG renderer would do the same with `style`
 * attributes, which the page's security policy forbids, as it forbids everything that could be smuggled into text.
 */

import { type Camera, type Color, LineBasicMaterial, MeshBasicMaterial, type Scene } from 'three';
import { Projector, RenderableFace, RenderableLine, type RenderableVertex } from 'three/addons/renderers/Projector.js';
import { svg } from '../dom';

/** Neighbouring triangles are drawn this much larger, in pixels, lest the ground shows between them. */
const OVERLAP = '0.7';

export class SvgPicture {
  readonly element = svg('svg', {});
  private readonly projector = new Projector();
  private readonly paths: SVGPathElement[] = [];
  private used = 0;
  private width = 1;
  private height = 1;
  private look = '';
  private outline = '';

  resize(width: number, height: number): void {
    this.width = width;
    this.height = height;
    this.element.setAttribute('width', String(width));
    this.element.setAttribute('height', String(height));
  }

  render(scene: Scene, camera: Camera): void {
    // Far things first, so that near ones cover them.
    const { elements } = this.projector.projectScene(scene, camera, true, true) as { elements: unknown[] };
    this.used = 0;
    for (const element of elements) {
      if (element instanceof RenderableFace && element.material instanceof MeshBasicMaterial) {
        const { color, vertexColors } = element.material;
        const shade = hex(vertexColors ? element.color : color);
        this.add(`${shade} ${shade} ${OVERLAP}`, [element.v1, element.v2, element.v3], 'Z');
      } else if (element instanceof RenderableLine && element.material instanceof LineBasicMaterial) {
        const { color, linewidth } = element.material;
        this.add(`none ${hex(color)} ${linewidth}`, [element.v1, element.v2], '');
      }
    }
    this.flush();
    for (const path of this.paths.splice(this.used)) path.remove();
  }

  /** Adds an outline to the path being drawn, or begins another if it looks different. */
  private add(look: string, vertices: RenderableVertex[], end: string): void {
    const points = vertices.map(({ positionScreen: { x, y } }) => [x, y] as const);
    for (const axis of [0, 1] as const) {
      if (points.every((point) => point[axis] > 1) || points.every((point) => point[axis] < -1)) return;
    }
    if (look !== this.look) {
      this.flush();
      this.look = look;
    }
    const places = points.map(([x, y]) => `${(((x + 1) / 2) * this.width).toFixed(1)} ${(((1 - y) / 2) * this.height).toFixed(1)}`);
    this.outline += `M${places.join('L')}${end}`;
  }

  /** Ends the path being drawn. Paths stay from picture to picture, in the order in which they are needed. */
  private flush(): void {
    if (!this.outline) return;
    let path = this.paths[this.used];
    if (!path) {
      path = svg('path', { 'stroke-linejoin': 'round', 'stroke-linecap': 'round' });
      this.paths.push(path);
      this.element.append(path);
    }
    this.used += 1;
    const [fill, stroke, width] = this.look.split(' ');
    path.setAttribute('fill', fill!);
    path.setAttribute('stroke', stroke!);
    path.setAttribute('stroke-width', width!);
    path.setAttribute('d', this.outline);
    this.look = '';
    this.outline = '';
  }
}

function hex(colour: Color): string {
  return `#${colour.getHexString()}`;
}
