/**
 * The connection to the ground station: one WebSocket, opened again with growing patience whenever it is lost.
 */

import { type ClientMessage, readMessage, type ServerMessage } from './protocol';

const FIRST_RETRY_MS = 500;
const LAST_RETRY_MS = 5000;
/** The station speaks ten times a second: after this long without a word the connection is dead, whatever TCP thinks. */
const SILENCE_MS = 10_000;

/** How long to wait before the next attempt, after so many in a row have failed. */
export function retryDelay(failures: number): number {
  return Math.min(FIRST_RETRY_MS * 2 ** Math.max(0, failures), LAST_RETRY_MS);
}

export interface ConnectionEvents {
  message(message: ServerMessage): void;
  /** `retryMs` says when the next attempt comes, if the connection is lost. */
  changed(live: boolean, retryMs: number): void;
}

export class Connection {
  /** Messages that this console could not read. */
  unread = 0;
  /** When the station last said something, on the clock of `performance.now()`. */
  lastHeard = 0;

  private socket: WebSocket | null = null;
  private failures = 0;

  constructor(
    private readonly url: string,
    private readonly events: ConnectionEvents,
  ) {
    this.open();
    window.setInterval(() => this.endIfSilent(), 1000);
  }

  get live(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  /** Sends an order or a question; `false` if there is no connection to send it on. */
  send(message: ClientMessage): boolean {
    if (!this.socket || !this.live) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  private open(): void {
    const socket = new WebSocket(this.url);
    this.socket = socket;
    socket.onopen = () => {
      this.failures = 0;
      this.lastHeard = performance.now();
      this.events.changed(true, 0);
    };
    socket.onmessage = (event) => {
      this.lastHeard = performance.now();
      const message = typeof event.data === 'string' ? readMessage(event.data) : null;
      if (message) this.events.message(message);
      else this.unread += 1;
    };
    socket.onclose = () => this.lost(socket);
  }

  /** Also called for a socket that was given up, whose own `close` may come much later or never. */
  private lost(socket: WebSocket): void {
    if (socket !== this.socket) return;
    this.socket = null;
    const delay = retryDelay(this.failures);
    this.failures += 1;
    this.events.changed(false, delay);
    window.setTimeout(() => this.open(), delay);
  }

  private endIfSilent(): void {
    const socket = this.socket;
    if (!socket || !this.live || performance.now() - this.lastHeard < SILENCE_MS) return;
    socket.close();
    this.lost(socket);
  }
}

/** Where the station listens: on the server this page came from. */
export function liveUrl(page: Location): string {
  return `${page.protocol === 'https:' ? 'wss' : 'ws'}://${page.host}/live`;
}
