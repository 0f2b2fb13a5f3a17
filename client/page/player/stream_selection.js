/** Which stream a player plays, and the address of that stream. */

/** @import {Moment} from '../timeline/time_shift.js' */

/**
 * @typedef {object} StreamSelection
 * @property {number} object number of the person
 * @property {string | null} camera the held camera; null: the best view
 * @property {string | null} prefer the preferred camera, shown while it sees the person; live only
 * @property {string | null} [delay] live or smooth; null: balanced; live pictures only
 * @property {Moment | null} past where playback of the past starts; null: live
 */

/**
 * @param {StreamSelection} selection
 * @param {string} container mp4 or webm
 * @param {Moment | null} from start of a past stream, later than `past` after a failure; null: live
 * @param {boolean} transcoded whether live pictures are encoded anew, as H.264
 * @returns {string} address relative to the page
 */
export function streamUrl({ object, camera, prefer, delay }, container, from, transcoded) {
  const name = encodeURIComponent(camera ?? prefer ?? '');
  if (from && camera !== null) return `cameras/${name}/live.${container}?from=p${from.pulse}`;
  if (from) return `objects/${object}/best.${container}?from=p${from.pulse}`;
  const query = new URLSearchParams(camera !== null ? { camera } : prefer !== null ? { prefer } : {});
  if (delay && prefer === null) query.set('delay', delay);
  if (transcoded) query.set('codec', 'h264');
  return `objects/${object}/best.${container}${query.size ? `?${query}` : ''}`;
}

/**
 * @param {StreamSelection} selection its preferred camera is ignored: HLS has none
 * @returns {string} address of the HLS playlist
 */
export function playlistUrl({ object, camera, past, delay }) {
  const stream = camera === null ? `objects/${object}` : `cameras/${encodeURIComponent(camera)}`;
  if (past) return `${stream}/hls/index.m3u8?from=p${past.pulse}`;
  return `${stream}/hls/index.m3u8${delay === 'smooth' && camera === null ? '?delay=smooth' : ''}`;
}

/**
 * @param {StreamSelection} one
 * @param {StreamSelection} other
 */
export function isSameSelection(one, other) {
  const sameStart = one.past?.pulse === other.past?.pulse && (one.delay ?? null) === (other.delay ?? null);
  return one.object === other.object && one.camera === other.camera && one.prefer === other.prefer && sameStart;
}
