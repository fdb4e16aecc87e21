/**
 * The buttons that begin a route by hand, and a rehearsal of the fleet as it is.
 */

import { html } from './dom';

export class RoutesPanel {
  private readonly begin = html('button', { class: 'link-button', type: 'button', title: 'Click the way of one vehicle, and send it (E)' }, 'Draw a route…');

  constructor(body: HTMLElement, begin: () => void, rehearse: () => void) {
    const rehearsal = html('button', { class: 'link-button', type: 'button', title: 'What would come of it if all flew on from here: flown in simulation, nobody is ordered anything' }, 'Rehearse…');
    this.begin.addEventListener('click', begin);
    rehearsal.addEventListener('click', rehearse);
    body.append(html('p', { class: 'send-script' }, this.begin, ' ', rehearsal));
  }

  setRouting(on: boolean): void {
    this.begin.setAttribute('aria-pressed', String(on));
  }
}
