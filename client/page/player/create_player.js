/** Creates the kind of player that the browser supports, or that the page's address asks for. */

import { HlsPlayer } from './hls_player.js';
import { MediaSourceClass } from './media/media_source.js';
import { MsePlayer } from './mse_player.js';
import { wantsWebRtc, WebRtcPlayer } from './webrtc_player.js';

/** @import {PlayerListener} from './mse_player.js' */

/**
 * @typedef {object} StreamFormat of all streams of a site
 * @property {string} container mp4 or webm
 * @property {string} codec RFC 6381: of the video, followed by a comma and that of the audio if there is any
 * @property {boolean} transcoded whether the server encodes the streams anew, as H.264: only live ones
 * @property {number | null} pulse0 Unix seconds of media time 0
 * @property {number} gopS seconds of a GOP, which may arrive in one burst
 */

/**
 * @param {HTMLVideoElement} video
 * @param {PlayerListener} listener
 * @returns {MsePlayer | HlsPlayer | WebRtcPlayer}
 */
export function createPlayer(video, listener) {
  if (wantsWebRtc()) return new WebRtcPlayer(video, listener);
  return MediaSourceClass ? new MsePlayer(video, listener) : new HlsPlayer(video, listener);
}
