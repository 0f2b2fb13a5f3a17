/** The offset of the server's clock, which the displayed delay is measured against, and the polling of /api/site for it. */

import { getJson, pause } from '../shared/requests.js';

/** @import {Viewer} from '../viewer.js' */

const SAMPLES_KEPT = 8;
const POLL_MS = 10_000;
const SAMPLES_PER_CONNECTION = 4; // one after the other
const SAMPLE_INTERVAL_MS = 250;
const CODEC_POLL_MS = 500; // while the codec of the streams is not known

/**
 * Estimate of the offset of the server's clock.
 *
 * As in NTP, the sample with the shortest round trip is the best: its error is at most half that round trip.
 */
export class ServerClock {
  /** @type {{offset: number, roundTrip: number}[]} */
  #samples = [];

  /**
   * @param {number} sent Date.now() when the request was sent, milliseconds
   * @param {number} received Date.now() when the answer was received, milliseconds
   * @param {number} now the server's Unix time in the answer, seconds
   */
  add(sent, received, now) {
    this.#samples.push({ offset: now * 1000 - (sent + received) / 2, roundTrip: received - sent });
    if (this.#samples.length > SAMPLES_KEPT) this.#samples.shift();
  }

  /** Delete all samples: another server may have another clock. */
  clear() {
    this.#samples = [];
  }

  /** @returns {number | null} milliseconds that the server's clock is ahead of this one; null: unknown */
  get offset() {
    if (!this.#samples.length) return null;
    return this.#samples.reduce((best, sample) => (sample.roundTrip < best.roundTrip ? sample : best)).offset;
  }
}

/** Polls /api/site for the server's clock and the site's properties. */
export class SitePoller {
  #clock = new ServerClock();
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  #codecTimer = undefined;

  /** @param {Viewer} viewer */
  constructor(viewer) {
    this.viewer = viewer;
    setInterval(() => this.#poll(), POLL_MS);
  }

  /** Measure the clock again after a (re)connection, possibly to another server. */
  async connected() {
    this.#clock.clear();
    for (let i = 0; i < SAMPLES_PER_CONNECTION; i += 1) {
      await this.#poll();
      await pause(SAMPLE_INTERVAL_MS);
    }
  }

  async #poll() {
    try {
      const sent = Date.now();
      const site = await getJson('api/site');
      this.#clock.add(sent, Date.now(), site.now);
      this.viewer.currentFrame.clockOffset = this.#clock.offset;
      this.viewer.setSite(site);
      clearTimeout(this.#codecTimer);
      if (site.codec === null) this.#codecTimer = setTimeout(() => this.#poll(), CODEC_POLL_MS);
    } catch {
      // ServerEvents reports a lost connection.
    }
  }
}
