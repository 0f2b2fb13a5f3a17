/**
 * The server's events, for as long as the page is open.
 *
 * EventSource reconnects by itself only after some failures, and slowly; so it is closed at every failure and
 * opened again. A connection that is open but idle is checked by an HTTP request.
 */

import { Backoff } from './backoff.js';
import { getJson } from './requests.js';

const NAMES = ['site', 'objects', 'cameras', 'gop', 'flag'];
const IDLE_MS = 6000;
const CHECK_MS = 2000;

export class ServerEvents {
  /** @type {EventSource | null} */
  #source = null;
  #backoff = new Backoff();
  #activeAt = 0; // performance.now()
  #checking = false;

  /**
   * @param {object} listener
   * @param {(name: string, data: any) => void} listener.received
   * @param {() => void} listener.opened
   * @param {() => void} listener.lost
   */
  constructor(listener) {
    this.listener = listener;
    this.#open();
    setInterval(() => this.#check(), CHECK_MS);
  }

  #open() {
    const source = new EventSource('api/events');
    this.#source = source;
    this.#activeAt = performance.now();
    source.onopen = () => {
      this.#backoff.reset();
      this.#activeAt = performance.now();
      this.listener.opened();
    };
    source.onerror = () => this.#lose(source);
    for (const name of NAMES) {
      source.addEventListener(name, (event) => {
        this.#activeAt = performance.now();
        this.listener.received(name, JSON.parse(/** @type {MessageEvent} */ (event).data));
      });
    }
  }

  /** @param {EventSource} source */
  #lose(source) {
    if (source !== this.#source) return;
    source.close();
    this.#source = null;
    this.listener.lost();
    setTimeout(() => this.#open(), this.#backoff.next());
  }

  async #check() {
    const source = this.#source;
    if (!source || this.#checking || performance.now() - this.#activeAt < IDLE_MS) return;
    this.#checking = true;
    try {
      await getJson('api/site');
      this.#activeAt = performance.now();
    } catch {
      this.#lose(source);
    } finally {
      this.#checking = false;
    }
  }
}
