/** What the operator is asked to look at: which flag is the most urgent, and in what words. No element. */

/** @import {Flag} from '../../shared/contract.js' */

export const NOW_S = 0.5; // within so much of it, it happens now

/** The flags that can be answered. */
export class Flags {
  /** @type {Map<number, Flag>} */
  #open = new Map();

  /** @param {Flag} flag as it is now */
  take(flag) {
    if (flag.state === 'raised' || flag.state === 'followed') this.#open.set(flag.id, flag);
    else this.#open.delete(flag.id);
  }

  /** Another run of the server raises others. */
  clear() {
    this.#open.clear();
  }

  /**
   * What is ahead before what is past, which can be answered for a while; the nearest first.
   *
   * @param {number} now the frame that is looked at; what was expected before it is past
   * @returns {Flag[]} the most urgent first
   */
  urgent(now) {
    const past = (/** @type {Flag} */ { pulse }) => Number(pulse < now);
    const away = (/** @type {Flag} */ { pulse }) => Math.abs(pulse - now);
    return [...this.#open.values()].sort(
      (a, b) => past(a) - past(b) || away(a) - away(b) || a.margin - b.margin || a.id - b.id,
    );
  }

  /**
   * @param {number | null} object
   * @param {number} now as of {@link urgent}
   * @returns {Flag | undefined} the most urgent that somebody is in
   */
  about(object, now) {
    return this.urgent(now).find(({ objects }) => object !== null && objects.includes(object));
  }
}

/**
 * @param {Flag} flag
 * @param {(object: number) => string} called what somebody is called
 * @returns {string} what may go wrong
 */
export function words({ objects, reason }, called) {
  const who = objects.map(called).join(' and ');
  if (reason === 'track_loss') return `${who} fades, or is lost from sight`;
  if (reason === 'optimality_gap') return `It is not sure who is ${objects.map(called).join(', and who is ')}`;
  if (objects.length < 2) return `${who} may be taken for somebody else`;
  return reason === 'crossing' ? `${who}, alike, cross` : `${who} may be taken for each other`;
}

/**
 * @param {Flag} flag
 * @param {number} pulse the frame that is shown
 * @param {number} fps
 * @returns {string} when, as seen by who looks at that frame
 */
export function when({ pulse: expected }, pulse, fps) {
  const left = (expected - pulse) / fps;
  if (Math.abs(left) < NOW_S) return 'now';
  return left > 0 ? `in ${left.toFixed(1)} s` : `${(-left).toFixed(0)} s ago`;
}
