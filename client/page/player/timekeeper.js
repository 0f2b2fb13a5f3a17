/** Asks the server for its clock, and what the site is: well at every connection and now and then after it. */

import { ServerClock } from './clock.js';
import { getJson, pause } from '../shared/requests.js';

/** @import {Viewer} from '../viewer.js' */

const EVERY_MS = 10_000;
const SAMPLES = 4; // one after the other, at every connection
const BETWEEN_MS = 250;
const SOON_MS = 500; // while the site itself does not know yet what its streams are

export class Timekeeper {
  #clock = new ServerClock();
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #soon = undefined;

  /** @param {Viewer} viewer */
  constructor(viewer) {
    this.viewer = viewer;
    setInterval(() => this.#ask(), EVERY_MS);
  }

  /** Another server may have another clock. */
  async begin() {
    this.#clock.clear();
    for (let i = 0; i < SAMPLES; i += 1) {
      await this.#ask();
      await pause(BETWEEN_MS);
    }
  }

  async #ask() {
    try {
      const sent = Date.now();
      const site = await getJson('api/site');
      this.#clock.add(sent, Date.now(), site.now);
      this.viewer.now.clockOffset = this.#clock.offset;
      this.viewer.setSite(site);
      clearTimeout(this.#soon);
      if (site.codec === null) this.#soon = setTimeout(() => this.#ask(), SOON_MS);
    } catch {
      // The events say when the server is away, and when it is back.
    }
  }
}
