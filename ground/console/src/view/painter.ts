/**
 * What paints the scene: WebGL where there is any, SVG where there is none. The rest of the view does not care, but for
 * how fine its shapes may be.
 */

import { type Camera, type Scene, WebGLRenderer } from 'three';
import { SvgPicture } from './svg-picture';

export interface Painter {
  kind: 'webgl' | 'svg';
  element: HTMLElement | SVGElement;
  /** The least time between two pictures. */
  intervalMs: number;
  paint(scene: Scene, camera: Camera): void;
  resize(width: number, height: number): void;
  /** The last pictures took this long each, so the painter may become coarser or slower. */
  took(ms: number): void;
}

export function makePainter(): Painter {
  return webgl() ?? svg();
}

/** Pixels per pixel of the page. */
const FINEST = 2;
const COARSEST = 0.75;
/** Pictures dearer than this become coarser. */
const DEAR_MS = 120;
const SHORTEST_MS = 1000 / 30;
const LONGEST_MS = 200;
/** So many times what a picture takes passes between two: without a GPU, painting keeps the page from answering. */
const PAUSE = 1.6;

function webgl(): Painter | null {
  // Asking for the context first keeps three.js from reporting a missing one as an error.
  const canvas = document.createElement('canvas');
  const context = canvas.getContext('webgl2', { antialias: true, alpha: false, powerPreference: 'low-power' });
  if (!context) return null;

  const renderer = new WebGLRenderer({ canvas, context, antialias: true });
  let ratio = Math.min(window.devicePixelRatio || 1, FINEST);
  renderer.setPixelRatio(ratio);
  const painter: Painter = {
    kind: 'webgl',
    element: canvas,
    intervalMs: SHORTEST_MS,
    paint: (scene, camera) => renderer.render(scene, camera),
    resize: (width, height) => renderer.setSize(width, height),
    took(ms) {
      painter.intervalMs = Math.min(LONGEST_MS, Math.max(SHORTEST_MS, ms * PAUSE));
      if (ms < DEAR_MS || ratio <= COARSEST) return;
      ratio = Math.max(COARSEST, ratio * 0.8);
      renderer.setPixelRatio(ratio);
    },
  };
  return painter;
}

function svg(): Painter {
  const picture = new SvgPicture();
  return {
    kind: 'svg',
    element: picture.element,
    intervalMs: 200,
    paint: (scene, camera) => picture.render(scene, camera),
    resize: (width, height) => picture.resize(width, height),
    took: () => {},
  };
}
