/**
 * The keyboard. Letters do what the buttons do, but never while the operator types or a dialog is open, and never by
 * repetition of a key held down.
 */

/** `digit` gets 0 to 9, and whether Shift is down; it says whether the digit means something to it. */
export function listenToKeys(actions: Record<string, () => void>, digit: (digit: string, more: boolean) => boolean): void {
  document.addEventListener('keydown', (event) => {
    if (event.repeat || event.ctrlKey || event.metaKey || event.altKey || document.querySelector('dialog[open]')) return;
    const typing = isField(event.target);
    if (event.key === 'Escape') {
      if (typing) (event.target as HTMLElement).blur();
      actions.Escape?.();
      return;
    }
    if (typing) return;
    const pressed = /^(?:Digit|Numpad)([0-9])$/.exec(event.code)?.[1];
    if (pressed && digit(pressed, event.shiftKey)) {
      event.preventDefault();
      return;
    }
    const action = actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  });
}

function isField(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && (target.isContentEditable || target.matches('input:not([type=checkbox]), textarea, select'));
}
