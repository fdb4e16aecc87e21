/**
 * The time line of a recording, shown in the place of a live swarm: play, pause, seek, speed.
 */

import { html, setText } from './dom';
import type { Replay } from './protocol';
import { clockWords } from './words';

const SPEEDS = [0.25, 0.5, 1, 2, 5, 10];

/** What the operator wants of the recording. */
export type ReplayWish = { play: boolean } | { at_s: number } | { speed: number };

export class ReplayBar {
  private readonly button = html('button', { type: 'button', class: 'command', title: 'Play or pause (P)' }, 'Play');
  private readonly line = html('input', { type: 'range', step: '0.1', 'aria-label': 'Time in the recording, in seconds' });
  private readonly clock = html('output', { class: 'replay-clock' });
  private readonly speed = html('select', { 'aria-label': 'Speed' });
  private readonly bar: HTMLElement;
  private replay: Replay | null = null;
  /** Whether the operator holds the time line: it is theirs then. */
  private held = false;

  constructor(
    stage: HTMLElement,
    private readonly wish: (wish: ReplayWish) => void,
  ) {
    this.speed.append(...SPEEDS.map((speed) => html('option', { value: String(speed) }, `× ${speed}`)));
    this.button.addEventListener('click', () => this.toggle());
    this.line.addEventListener('input', () => {
      this.held = true;
      setText(this.clock, clockWords(Number(this.line.value)));
    });
    this.line.addEventListener('change', () => {
      this.held = false;
      this.wish({ at_s: Number(this.line.value) });
    });
    this.speed.addEventListener('change', () => this.wish({ speed: Number(this.speed.value) }));
    const note = html('strong', { class: 'replay-note' }, 'Recording: orders are off');
    this.bar = html('div', { class: 'replay-bar', role: 'group', 'aria-label': 'Recording', hidden: true }, note, this.button, this.line, this.clock, this.speed);
    stage.append(this.bar);
  }

  /** Whether what is shown is a recording. */
  get active(): boolean {
    return this.replay !== null;
  }

  toggle(): void {
    if (this.replay) this.wish({ play: !this.replay.playing });
  }

  show(replay: Replay): void {
    this.replay = replay;
    this.bar.hidden = false;
    setText(this.button, replay.playing ? 'Pause' : 'Play');
    this.line.min = String(replay.from_s);
    this.line.max = String(replay.to_s);
    this.speed.value = String(SPEEDS.reduce((best, speed) => (Math.abs(speed - replay.speed) < Math.abs(best - replay.speed) ? speed : best), 1));
    if (this.held) return;
    this.line.value = String(replay.at_s);
    setText(this.clock, `${clockWords(replay.at_s)} of ${clockWords(replay.to_s)}${replay.complete ? '' : ', cut short'}`);
  }
}
