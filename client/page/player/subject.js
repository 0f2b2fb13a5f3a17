/** Whom a player is to show, by which camera and from when on; and where the server has that stream. */

/** @import {Moment} from '../timeline/time_shift.js' */

/**
 * @typedef {object} Subject
 * @property {number} object who is to be seen
 * @property {string | null} camera by which; null: by whichever sees them best
 * @property {string | null} prefer the camera that is shown while it sees them; null: none is preferred
 * @property {Moment | null} past where to begin; null: live, and only then a camera can be preferred
 */

/**
 * @param {Subject} subject
 * @param {string} container mp4 or webm
 * @param {Moment | null} from where to begin: where the past is watched, and goes on after a failure
 */
export function streamOf({ object, camera, prefer }, container, from) {
  const name = encodeURIComponent(camera ?? prefer ?? '');
  if (from && camera !== null) return `cameras/${name}/live.${container}?from=p${from.pulse}`;
  if (from) return `objects/${object}/best.${container}?from=p${from.pulse}`;
  const query = camera !== null ? `?camera=${name}` : prefer !== null ? `?prefer=${name}` : '';
  return `objects/${object}/best.${container}${query}`;
}

/**
 * @param {Subject} subject whose preferred camera HLS does not know
 * @returns {string} where its playlist is
 */
export function playlistOf({ object, camera, past }) {
  const stream = camera === null ? `objects/${object}` : `cameras/${encodeURIComponent(camera)}`;
  return `${stream}/hls/index.m3u8${past ? `?from=p${past.pulse}` : ''}`;
}

/**
 * @param {Subject} one
 * @param {Subject} other
 */
export function same(one, other) {
  const moments = one.past?.pulse === other.past?.pulse;
  return one.object === other.object && one.camera === other.camera && one.prefer === other.prefer && moments;
}
