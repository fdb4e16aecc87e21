/**
 * Dark or light: as the system says, until the operator chooses; the choice is remembered where the browser allows it.
 */

const KEY = 'skein-theme';
type Name = 'dark' | 'light';

export class Theme {
  private readonly system = window.matchMedia('(prefers-color-scheme: light)');
  private chosen: Name | null = recall();

  constructor(private readonly changed: () => void) {
    this.apply();
    this.system.addEventListener('change', () => this.apply());
  }

  toggle(): void {
    this.chosen = this.current === 'dark' ? 'light' : 'dark';
    remember(this.chosen);
    this.apply();
  }

  private get current(): Name {
    return this.chosen ?? (this.system.matches ? 'light' : 'dark');
  }

  private apply(): void {
    document.documentElement.dataset.theme = this.current;
    this.changed();
  }
}

function recall(): Name | null {
  try {
    const name = window.localStorage.getItem(KEY);
    return name === 'dark' || name === 'light' ? name : null;
  } catch {
    return null;
  }
}

/** Storage may be forbidden; then the choice holds until the page is closed. */
function remember(name: Name): void {
  try {
    window.localStorage.setItem(KEY, name);
  } catch {
    // Nothing is lost but convenience.
  }
}
