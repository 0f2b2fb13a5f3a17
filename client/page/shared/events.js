/**
 * The server's events, for as long as the page is open.
 *
 * EventSource reconnects by itself only after some failures, and slowly; so it is closed at every failure and
 * opened again. A connection that is open but idle is checked by an HTTP request.
 */

import { Backoff } from './backoff.js';
import { getJson } from './requests.js';
import { currentServer, leaveServer, onServerChange } from './servers.js';

const NAMES = ['site', 'objects', 'cameras', 'delays', 'gop', 'flag'];
const IDLE_MS = 6000;
const CHECK_MS = 2000;
const REPLACED_MS = 100; // before another service is asked

export class ServerEvents {
  /** @type {EventSource | null} */
  #source = null;
  #server = '';
  #backoff = new Backoff();
  #activeAt = 0; // performance.now()
  #checking = false;
  /** @type {string | null} */
  #delay;

  /**
   * @param {object} listener
   * @param {(name: string, data: any) => void} listener.received
   * @param {() => void} listener.opened
   * @param {() => void} listener.lost
   * @param {string | null} [delay] whose decisions are received; null: balanced
   */
  constructor(listener, delay = null) {
    this.listener = listener;
    this.#delay = delay;
    this.#open();
    setInterval(() => this.#check(), CHECK_MS);
    onServerChange(() => this.#source && this.#lose(this.#source));
  }

  /** @param {string | null} delay whose decisions to receive from now on */
  choose(delay) {
    if (delay === this.#delay) return;
    this.#delay = delay;
    if (!this.#source) return; // it is about to be opened
    this.#source.close();
    this.#open();
  }

  #open() {
    const source = new EventSource(`api/events${this.#delay ? `?delay=${this.#delay}` : ''}`);
    this.#source = source;
    this.#server = currentServer();
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
    const replaced = leaveServer(this.#server);
    const wait = this.#backoff.next();
    setTimeout(() => this.#open(), replaced ? Math.min(wait, REPLACED_MS) : wait);
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
