/**
 * Light, painted into shapes once: it never changes, costs nothing, and looks the same under either painter.
 */

import { BufferAttribute, BufferGeometry, Color, Vector3 } from 'three';

/** Where light comes from: high in the south-west. */
const SUN = new Vector3(-0.45, -0.35, 0.82).normalize();

/**
 * One geometry of all `shapes`, lit from the sun: each vertex by its own normal, or, where `flat`, each triangle by the
 * mean of its normals, because the SVG painter has one colour per triangle.
 */
export function shaded(shapes: readonly BufferGeometry[], lit: Color, shade: Color, flat: boolean): BufferGeometry {
  const places: number[] = [];
  const colours: number[] = [];
  const [normal, colour] = [new Vector3(), new Color()];
  for (const shape of shapes) {
    const triangles = shape.index ? shape.toNonIndexed() : shape;
    const position = triangles.getAttribute('position');
    const normals = triangles.getAttribute('normal');
    for (let i = 0; i < position.count; i += 1) {
      places.push(position.getX(i), position.getY(i), position.getZ(i));
      normal.set(0, 0, 0);
      const first = i - (i % 3);
      for (const j of flat ? [first, first + 1, first + 2] : [i]) {
        normal.add(new Vector3(normals.getX(j), normals.getY(j), normals.getZ(j)));
      }
      colour.lerpColors(shade, lit, 0.5 + 0.5 * normal.normalize().dot(SUN));
      colours.push(colour.r, colour.g, colour.b);
    }
  }
  const merged = new BufferGeometry();
  merged.setAttribute('position', new BufferAttribute(new Float32Array(places), 3));
  merged.setAttribute('color', new BufferAttribute(new Float32Array(colours), 3));
  return merged;
}
