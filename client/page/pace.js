/**
 * How the player stays live: pure arithmetic on what is buffered, no clock and no element of its own.
 *
 * Frames may come one by one or a GOP at a time, so the lead (seconds buffered beyond the frame now
 * shown) swings by itself. What counts is its lowest point over the last moments: the slack. Too much
 * slack is delay that nobody needs, none is a picture that stops.
 */

const RECENT_S = 1.5; // over which the lowest lead is looked for: more than the longest GOP
const CALM_S = 4; // before hurrying, over this: a rough network's next gap may be seconds away
const SLACK_S = 0.12; // aimed at: three frames at 25 per second
const MOST_SLACK_S = 1;
const FASTER_AT_S = 0.15; // above the aim
const SLOWER_AT = 0.35; // of the aim
const FAR_S = 3; // beyond this a jump is kinder than minutes of hurry
const FASTER = 1.25;
const SLOWER = 0.94;
const EDGE_S = 0.06; // closer to the end of a range than this, the picture stands
const CALM_PER_S = 0.01; // how fast the aim comes back after the network was rough

/**
 * @typedef {object} Step
 * @property {number} rate the playback rate from now on
 * @property {number | null} seek media time to jump to
 */

export class Pace {
  /** @type {{now: number, lead: number}[]} */
  #leads = [];
  #aim = SLACK_S;
  #rate = 1;
  #last = 0;

  /** After a jump or a switch the old leads say nothing. */
  reset() {
    this.#leads = [];
    this.#rate = 1;
  }

  /** The picture stood for want of frames: keep further away from the edge for a while. */
  stalled() {
    this.#aim = Math.min(1.5 * this.#aim + 0.05, MOST_SLACK_S);
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
    if (lead > FAR_S) return this.#jump(Math.max(end - this.#aim, /** @type {any} */ (ranges.at(-1))[0]));
    this.#aim = Math.max(SLACK_S, this.#aim - CALM_PER_S * Math.max(0, now - this.#last));
    this.#last = now;
    this.#leads.push({ now, lead });
    this.#rate = this.#choose(now);
    return { rate: this.#rate, seek: null };
  }

  /** @param {number} now */
  #choose(now) {
    const old = this.#leads.findIndex((sample) => sample.now >= now - CALM_S);
    this.#leads.splice(0, old);
    const slack = lowest(this.#leads.filter((sample) => sample.now >= now - RECENT_S));
    if (slack < SLOWER_AT * this.#aim) return SLOWER;
    if (this.#rate < 1) return slack < 0.8 * this.#aim ? SLOWER : 1;
    if (this.#rate > 1) return slack > this.#aim + 0.02 ? FASTER : 1;
    const calm = old > 0; // that long was seen; before, the lowest point may be to come
    return calm && lowest(this.#leads) > this.#aim + FASTER_AT_S ? FASTER : 1;
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

/** @param {{lead: number}[]} samples */
function lowest(samples) {
  return Math.min(...samples.map((sample) => sample.lead));
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
