/**
 * Tells a click in the view from a drag, which orbits.
 */

/** Farther than this and it was a drag. */
const SLIP_PX = 5;

export interface PointingEvents {
  clicked(x: number, y: number, more: boolean): void;
  hovered(x: number, y: number): void;
  left(): void;
}

export class Pointing {
  private pressed: { id: number; x: number; y: number } | null = null;

  constructor(
    private readonly element: HTMLElement,
    private readonly events: PointingEvents,
  ) {
    element.addEventListener('pointerdown', (event) => this.down(event));
    element.addEventListener('pointerup', (event) => this.up(event));
    element.addEventListener('pointercancel', () => (this.pressed = null));
    element.addEventListener('pointermove', (event) => events.hovered(...this.place(event)));
    element.addEventListener('pointerleave', () => events.left());
  }

  private down(event: PointerEvent): void {
    const [x, y] = this.place(event);
    this.pressed = event.button === 0 && event.isPrimary ? { id: event.pointerId, x, y } : null;
  }

  private up(event: PointerEvent): void {
    const from = this.pressed;
    this.pressed = null;
    if (!from || from.id !== event.pointerId) return;
    const [x, y] = this.place(event);
    if (Math.hypot(x - from.x, y - from.y) > SLIP_PX) return;
    this.events.clicked(x, y, event.shiftKey || event.ctrlKey || event.metaKey);
  }

  private place(event: PointerEvent): [x: number, y: number] {
    const { left, top } = this.element.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  }
}
