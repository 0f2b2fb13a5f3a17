/** A live stream as whole segments, in bunches as they arrive. */

import { atLeast } from '../gops.js';
import { Refused } from '../../shared/requests.js';
import { SegmentSplitter } from './mp4.js';
import { ClusterSplitter } from './webm.js';

/** @import {Segment} from './mp4.js' */

const SILENCE_S = 6; // a live stream that says nothing for this long is dead, whatever TCP thinks

/**
 * @param {string} address of an MP4, or of a WebM by its ending
 * @param {AbortSignal} signal
 * @param {number} gopS seconds of a GOP
 * @returns {AsyncGenerator<Segment[], void>}
 * @throws {Error} when there is no such stream, or it fails or falls silent; returns when it ends
 */
export async function* download(address, signal, gopS) {
  const silence = new AbortController();
  const longest = 1000 * atLeast(SILENCE_S, gopS);
  let timer = setTimeout(() => silence.abort(), longest);
  const leave = () => silence.abort(); // AbortSignal.any is younger than the oldest iPhones that can play this
  signal.addEventListener('abort', leave);
  if (signal.aborted) leave();
  try {
    const response = await fetch(address, { cache: 'no-store', signal: silence.signal });
    if (!response.ok || !response.body) throw new Refused(address, response.status);
    const reader = response.body.getReader();
    const splitter = address.split('?')[0].endsWith('.webm') ? new ClusterSplitter() : new SegmentSplitter();
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      clearTimeout(timer);
      timer = setTimeout(() => silence.abort(), longest);
      const segments = splitter.push(value);
      if (segments.length) yield segments;
    }
  } finally {
    clearTimeout(timer);
    signal.removeEventListener('abort', leave);
    silence.abort(); // whoever leaves early leaves no connection open
  }
}
