/**
 * Graphics cards are not garbage collected.
 */

import type { Mesh, Object3D } from 'three';

/** Frees what an object and its children hold on the graphics card. */
export function dispose(object: Object3D): void {
  object.traverse((each) => {
    const { geometry, material } = each as Partial<Mesh>;
    geometry?.dispose();
    for (const one of Array.isArray(material) ? material : material ? [material] : []) one.dispose();
  });
}
