/** When the video element switches to a newly started stream, and at which media time. */

import { atLeastTwoGops } from './latency_control.js';

/** @import {StreamDownload} from './media/stream_download.js' */

const RESTARTED_S = 10; // a stream that starts this far back belongs to a site whose pulses have restarted
const CATCH_UP_MS = 300; // how long a new stream may take to reach the displayed media time
const LATER_S = 1.2;
const INSIDE_S = 0.001; // a seek to the very start of a range may round to just before it

/**
 * @param {number} start media time of a stream's first frame
 * @param {number} time displayed media time
 * @param {number} gopS seconds of a GOP
 * @returns {boolean} whether the site's pulses have restarted
 */
export function hasRestarted(start, time, gopS) {
  return start < time - atLeastTwoGops(RESTARTED_S, gopS);
}

/**
 * @param {StreamDownload} stream being buffered over the displayed one
 * @param {number} time media time of a displayed frame
 * @returns {boolean} whether the frame may be the new stream's: playback may run into it before the seek
 */
export function mayBelongTo({ start, onScreen }, time) {
  return !onScreen && time >= start - INSIDE_S;
}

/**
 * @param {StreamDownload} stream with frames in the buffer
 * @param {number} end media time up to which it is buffered
 * @param {number} time displayed media time
 * @param {number} now performance.now()
 * @returns {number | null} media time to seek to; null: wait until more is buffered
 */
export function switchTime({ start, bufferedAt, gopS, selection: { past } }, end, time, now) {
  if (past) return end > past.time ? Math.max(past.time, start) + INSIDE_S : null;
  if (start <= time && time < end) return time;
  // A stream that ends further back is later than the displayed one: it will not catch up.
  const isLater = end < time - atLeastTwoGops(LATER_S, gopS);
  const unreachable = time < start || isLater || hasRestarted(start, time, gopS);
  return unreachable || now - bufferedAt >= CATCH_UP_MS ? start + INSIDE_S : null;
}
