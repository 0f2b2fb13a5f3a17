/**
 * How the player stays live: pure arithmetic on what is buffered, no clock and no element of its own.
 *
 * Frames may come one by one or a GOP at a time, so the lead (seconds buffered beyond the frame now
 * shown) swings by itself. What counts is its lowest point: the slack. Too much slack is delay that
 * nobody needs, none is a picture that stops. How far the stream's edge runs behind the clock at worst
 * does not depend on what is shown, so all of the last while tells the slack of the moment now shown.
 */

import { atLeast } from './gops.js';

const RECENT_S = 15; // in which the edge was furthest behind at some time: a network's rough moments recur
const CALM_S = 4; // before hurrying, so long at least: the next gap may be seconds away
const HALF = 0.5; // of the time since the beginning counts at most: beginnings are rough, and soon over
const SLACK_S = 0.08; // aimed at: two frames at 25 per second
const MOST_SLACK_S = 1;
const STALLED_S = 0.06; // more slack for each time the picture stood
const CALM_PER_S = 0.01; // how fast the aim comes back after the network was rough
const FASTER_AT_S = 0.03; // above the aim
const FASTER_UNTIL_S = 0.005; // above the aim
const FASTER_PER_S = 1; // faster for each second above the aim: to hurry a little is not seen
const FASTER = 1.25; // at most
const SLOWER_AT = 0.35; // of the aim
const SLOWER_UNTIL = 0.8; // of the aim
const SLOWER = 0.94;
const FAR_S = 3; // beyond this a jump is kinder than minutes of hurry
const EDGE_S = 0.06; // closer to the end of a range than this, the picture stands

/**
 * @typedef {object} Step
 * @property {number} rate the playback rate from now on
 * @property {number | null} seek media time to jump to
 */

export class Pace {
  /** @type {{now: number, edge: number}[]} where the stream ended, less the clock */
  #edges = [];
  #begun = NaN;
  #aim = SLACK_S;
  #rate = 1;
  #last = 0;
  /** Seconds of a GOP, which may come all at once. */
  gopS = 0;

  /** After a jump or a switch what was before says nothing. */
  reset() {
    this.#edges = [];
    this.#begun = NaN;
    this.#rate = 1;
  }

  /** The picture stood for want of frames: keep further away from the edge for a while. */
  stalled() {
    this.#aim = Math.min(this.#aim + STALLED_S, MOST_SLACK_S);
  }

  /**
   * @param {number} now seconds of any steady clock
   * @param {number} time media time now shown
   * @param {[number, number][]} ranges what is buffered, in order
   * @returns {Step}
   */
  step(now, time, ranges) {
    const hole = overHole(time, ranges);
    if (hole !== null) return this.#jump(hole);
    const end = ranges.at(-1)?.[1] ?? time;
    const lead = end - time;
    if (lead > atLeast(FAR_S, this.gopS)) return this.#jump(Math.max(end - this.#aim, /** @type {any} */ (ranges.at(-1))[0]));
    this.#aim = Math.max(SLACK_S, this.#aim - CALM_PER_S * Math.max(0, now - this.#last));
    this.#last = now;
    this.#edges.push({ now, edge: end - now });
    this.#rate = this.#choose(now, time);
    return { rate: this.#rate, seek: null };
  }

  /**
   * @param {number} now
   * @param {number} time
   */
  #choose(now, time) {
    if (Number.isNaN(this.#begun)) this.#begun = now;
    const calmS = atLeast(CALM_S, this.gopS);
    const recent = Math.min(Math.max(HALF * (now - this.#begun), calmS), Math.max(RECENT_S, calmS));
    const old = this.#edges.findIndex((sample) => sample.now >= now - recent);
    this.#edges.splice(0, old);
    const slack = Math.min(...this.#edges.map((sample) => sample.edge)) + now - time;
    const over = slack - this.#aim;
    if (slack < SLOWER_AT * this.#aim) return SLOWER;
    if (this.#rate < 1 && slack < SLOWER_UNTIL * this.#aim) return SLOWER;
    const calm = now - this.#begun >= calmS; // before, the lowest point may be to come
    if (!calm || over < (this.#rate > 1 ? FASTER_UNTIL_S : FASTER_AT_S)) return 1;
    return Math.min(1 + FASTER_PER_S * over, FASTER);
  }

  /**
   * @param {number} seek
   * @returns {Step}
   */
  #jump(seek) {
    this.reset();
    return { rate: 1, seek };
  }
}

/**
 * MSE stops for good at a hole of two frames or more: the next range is where to go on.
 *
 * @param {number} time
 * @param {[number, number][]} ranges
 * @returns {number | null}
 */
function overHole(time, ranges) {
  const next = ranges.find(([start]) => start > time);
  if (!next) return null;
  const here = ranges.find(([start, end]) => start <= time && time < end - EDGE_S);
  return here ? null : next[0] + 0.001;
}
