/** When the picture goes over to a stream that has just begun, and at which moment. */

import { atLeast } from './gops.js';

/** @import {Run} from './media/stream_download.js' */

const RESTARTED_S = 10; // a stream that begins this far back is of a site whose pulses began anew
const LANDING_MS = 300; // how long a new stream may take to reach the moment now shown
const INSIDE_S = 0.001; // a seek to the very start of a range may round to just before it

/**
 * @param {number} start media time of a stream's first frame
 * @param {number} time media time now shown
 * @param {number} gopS seconds of a GOP
 * @returns {boolean} whether its pulses have begun anew
 */
export function begunAnew(start, time, gopS) {
  return start < time - atLeast(RESTARTED_S, gopS);
}

/**
 * @param {Run} run some of which is in the buffer
 * @param {number} end media time up to which it is
 * @param {number} time media time now shown
 * @param {number} now performance.now()
 * @returns {number | null} where to go; null: the picture waits for more of it
 */
export function landingOf({ start, since, gopS, subject: { past } }, end, time, now) {
  if (past) return end > past.time ? Math.max(past.time, start) + INSIDE_S : null;
  if (start <= time && time < end) return time;
  const ahead = time < start || begunAnew(start, time, gopS);
  return ahead || now - since >= LANDING_MS ? start + INSIDE_S : null;
}
