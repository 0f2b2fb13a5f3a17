/**
 * Live latency control: the playback rate and the seeks that keep a live stream close to the live edge.
 *
 * Frames may arrive one by one or a GOP at a time, so the lead (seconds buffered beyond the displayed frame)
 * oscillates. What counts is its minimum, the slack: too much is unnecessary delay, none stalls the video. How far
 * the live edge lags behind the clock at worst does not depend on what is displayed, so the samples of the last
 * seconds give the slack of the current position. Pure arithmetic: no clock, no DOM.
 */

const RECENT_S = 15; // window of the minimum: irregular arrivals recur
const SETTLE_S = 4; // minimum time before speeding up: the next gap may be seconds away
const MAX_WINDOW_SHARE = 0.5; // of the time since the start, so that an irregular start is soon forgotten
const SLACK_S = 0.08; // target: two frames at 25 per second
const MAX_SLACK_S = 1;
const STALL_SLACK_S = 0.06; // added to the target at each stall
const RECOVERY_PER_S = 0.01; // how fast the target returns after stalls
const FASTER_AT_S = 0.03; // above the target
const FASTER_UNTIL_S = 0.005; // above the target
const FASTER_PER_S = 1; // rate increase per second above the target
const MAX_RATE = 1.25;
const SLOWER_AT = 0.35; // of the target
const SLOWER_UNTIL = 0.8; // of the target
const SLOW_RATE = 0.94;
const JUMP_S = 3; // a lead beyond this is skipped by a seek
const EDGE_S = 0.06; // closer to the end of a range than this, the video stalls
const MIN_GOPS = 2;

/**
 * @param {number} seconds a limit on waiting for frames
 * @param {number} gopS seconds of a GOP, which may arrive in one burst
 * @returns {number} the limit, raised to two GOPs if it is shorter
 */
export const atLeastTwoGops = (seconds, gopS) => Math.max(seconds, MIN_GOPS * gopS);

/**
 * @typedef {object} Step
 * @property {number} rate playback rate
 * @property {number | null} seek media time to jump to
 */

export class LatencyController {
  /** @type {{now: number, edge: number}[]} end of the stream minus the clock */
  #edges = [];
  #start = NaN;
  #target = SLACK_S;
  #rate = 1;
  #last = 0;
  /** Seconds of a GOP, which may arrive in one burst. */
  gopS = 0;

  /** Discard the samples after a seek or a switch of streams. */
  reset() {
    this.#edges = [];
    this.#start = NaN;
    this.#rate = 1;
  }

  /** The video has stalled: raise the target for a while. */
  stalled() {
    this.#target = Math.min(this.#target + STALL_SLACK_S, MAX_SLACK_S);
  }

  /**
   * @param {number} now seconds of a monotonic clock
   * @param {number} time displayed media time
   * @param {[number, number][]} ranges buffered, in order
   * @returns {Step}
   */
  step(now, time, ranges) {
    const afterGap = findRangeAfterGap(time, ranges);
    if (afterGap !== null) return this.#jump(afterGap);
    const end = ranges.at(-1)?.[1] ?? time;
    const lead = end - time;
    if (lead > atLeastTwoGops(JUMP_S, this.gopS)) {
      return this.#jump(Math.max(end - this.#target, /** @type {any} */ (ranges.at(-1))[0]));
    }
    this.#target = Math.max(SLACK_S, this.#target - RECOVERY_PER_S * Math.max(0, now - this.#last));
    this.#last = now;
    this.#edges.push({ now, edge: end - now });
    this.#rate = this.#chooseRate(now, time);
    return { rate: this.#rate, seek: null };
  }

  /**
   * @param {number} now
   * @param {number} time
   */
  #chooseRate(now, time) {
    if (Number.isNaN(this.#start)) this.#start = now;
    const settleS = atLeastTwoGops(SETTLE_S, this.gopS);
    const share = MAX_WINDOW_SHARE * (now - this.#start);
    const recent = Math.min(Math.max(share, settleS), Math.max(RECENT_S, settleS));
    const firstRecent = this.#edges.findIndex((sample) => sample.now >= now - recent);
    this.#edges.splice(0, firstRecent);
    const slack = Math.min(...this.#edges.map((sample) => sample.edge)) + now - time;
    const excess = slack - this.#target;
    if (slack < SLOWER_AT * this.#target) return SLOW_RATE;
    if (this.#rate < 1 && slack < SLOWER_UNTIL * this.#target) return SLOW_RATE;
    const settled = now - this.#start >= settleS; // before, the minimum may be yet to come
    if (!settled || excess < (this.#rate > 1 ? FASTER_UNTIL_S : FASTER_AT_S)) return 1;
    return Math.min(1 + FASTER_PER_S * excess, MAX_RATE);
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
 * MSE stalls for good at a gap of two frames or more.
 *
 * @param {number} time
 * @param {[number, number][]} ranges
 * @returns {number | null} start of the next range; null: there is no gap at this time
 */
function findRangeAfterGap(time, ranges) {
  const next = ranges.find(([start]) => start > time);
  if (!next) return null;
  const current = ranges.find(([start, end]) => start <= time && time < end - EDGE_S);
  return current ? null : next[0] + 0.001;
}
