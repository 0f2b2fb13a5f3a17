/**
 * The server's events, for as long as the page lives.
 *
 * EventSource reconnects by itself only from some failures, and slowly; so this closes it at every
 * failure and opens a new one. A link that is open but silent is asked about over HTTP.
 */

import { Backoff } from './backoff.js';
import { getJson } from './requests.js';

const NAMES = ['site', 'objects', 'cameras', 'gop', 'flag'];
const SILENCE_MS = 6000;
const CHECK_MS = 2000;

export class ServerEvents {
  /** @type {EventSource | null} */
  #source = null;
  #backoff = new Backoff();
  #heard = 0;
  #checking = false;

  /**
   * @param {object} listener
   * @param {(name: string, data: any) => void} listener.heard
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
    this.#heard = performance.now();
    source.onopen = () => {
      this.#backoff.reset();
      this.#heard = performance.now();
      this.listener.opened();
    };
    source.onerror = () => this.#lose(source);
    for (const name of NAMES) {
      source.addEventListener(name, (event) => {
        this.#heard = performance.now();
        this.listener.heard(name, JSON.parse(/** @type {MessageEvent} */ (event).data));
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
    if (!source || this.#checking || performance.now() - this.#heard < SILENCE_MS) return;
    this.#checking = true;
    try {
      await getJson('api/site');
      this.#heard = performance.now();
    } catch {
      this.#lose(source);
    } finally {
      this.#checking = false;
    }
  }
}
