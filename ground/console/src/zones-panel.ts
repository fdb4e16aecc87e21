/**
 * What is drawn on the map: one line each, with how many vehicles keep it, who does not and why, and a button that
 * removes it; and a button that begins another.
 */

import { html } from './dom';
import type { Answer, Zone } from './protocol';
import { spaced } from './words';

export class ZonesPanel {
  private readonly list = html('ul', { class: 'scripts zones', 'aria-label': 'Zones that are drawn', hidden: true });
  private readonly begin = html('button', { class: 'link-button', type: 'button', title: 'Where nobody flies, or everybody stays (Z)' }, 'Draw a zone…');
  /** What is shown, so that a button stays under the pointer while nothing changes. */
  private shown = '';

  constructor(
    body: HTMLElement,
    private readonly remove: (name: string) => void,
    begin: () => void,
  ) {
    this.begin.addEventListener('click', begin);
    body.append(this.list, html('p', { class: 'send-script' }, this.begin));
  }

  setDrawing(drawing: boolean): void {
    this.begin.setAttribute('aria-pressed', String(drawing));
  }

  show(zones: readonly Zone[]): void {
    const shown = JSON.stringify(zones.map(({ zone, by, going, answers }) => [zone, by, going, answers]));
    if (shown === this.shown) return;
    this.shown = shown;
    this.list.hidden = zones.length === 0;
    this.list.replaceChildren(...zones.map((zone) => this.line(zone)));
  }

  private line(record: Zone): HTMLLIElement {
    const { zone, going } = record;
    const button = html('button', { class: 'link-button', type: 'button', 'data-remove': zone.name, disabled: going }, going ? 'Going…' : 'Remove');
    button.addEventListener('click', () => this.remove(zone.name));
    const words = html('span', {}, html('strong', {}, zone.name), ` ${zoneWords(record)}`);
    return html('li', { class: 'script zone', 'data-zone': zone.name, title: `By ${record.by}` }, words, button);
  }
}

/** Its kind, and who keeps it: `no fly, kept by 19 of 20; uav/4 missing`. */
export function zoneWords({ zone, going, answers }: Zone): string {
  const all = Object.entries(answers);
  const open = all.filter(([, { state }]) => state !== 'acknowledged');
  const kept = `${going ? 'gone from' : 'kept by'} ${all.length - open.length} of ${all.length}`;
  return [`${spaced(zone.kind)}, ${kept}`, ...open.map(([vehicle, answer]) => `${vehicle} ${answerWords(answer)}`)].join('; ');
}

function answerWords(answer: Answer): string {
  return answer.state === 'refused' ? `refused: ${answer.why}` : answer.state;
}
