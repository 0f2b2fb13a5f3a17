/** The order of flags by urgency, and their descriptions. No DOM. */

/** @import {Flag} from '../../shared/api_types.js' */

export const NOW_S = 0.5; // an event within this time happens now

/** The flags that can be answered. */
export class OpenFlags {
  /** @type {Map<number, Flag>} */
  #flags = new Map();

  /** @param {Flag} flag */
  update(flag) {
    if (flag.state === 'raised' || flag.state === 'followed') this.#flags.set(flag.id, flag);
    else this.#flags.delete(flag.id);
  }

  /** Delete all: after a reconnection the server sends the open ones again. */
  clear() {
    this.#flags.clear();
  }

  /**
   * Sort the flags: future events before past ones, which can be answered for a while; then the nearest first.
   *
   * @param {number} now pulse; events expected before it are past
   * @returns {Flag[]} the most urgent first
   */
  byUrgency(now) {
    const past = (/** @type {Flag} */ { pulse }) => Number(pulse < now);
    const distance = (/** @type {Flag} */ { pulse }) => Math.abs(pulse - now);
    return [...this.#flags.values()].sort(
      (a, b) => past(a) - past(b) || distance(a) - distance(b) || a.margin - b.margin || a.id - b.id,
    );
  }

  /**
   * @param {number | null} object
   * @param {number} now as of {@link byUrgency}
   * @returns {Flag | undefined} the most urgent flag that involves a person
   */
  mostUrgentOf(object, now) {
    return this.byUrgency(now).find(({ objects }) => object !== null && objects.includes(object));
  }
}

/**
 * @param {Flag} flag
 * @param {(object: number) => string} labelOf
 * @returns {string} the predicted failure
 */
export function describeFlag({ objects, reason }, labelOf) {
  const people = objects.map(labelOf).join(' and ');
  if (reason === 'track_loss') return `${people} may be lost`;
  if (reason === 'optimality_gap') return `${people}: identities uncertain`;
  if (objects.length < 2) return `${people} may be mistaken for someone else`;
  return reason === 'crossing' ? `${people} look alike and cross` : `${people} may be swapped`;
}

/**
 * @param {Flag} flag
 * @param {number} pulse displayed
 * @param {number} fps
 * @returns {string} when the event is expected, relative to the displayed frame
 */
export function describeTime({ pulse: expected }, pulse, fps) {
  const seconds = (expected - pulse) / fps;
  if (Math.abs(seconds) < NOW_S) return 'now';
  return seconds > 0 ? `in ${seconds.toFixed(1)} s` : `${(-seconds).toFixed(0)} s ago`;
}
