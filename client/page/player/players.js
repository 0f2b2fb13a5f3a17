/** A player as this browser has it. */

import { HlsPlayer } from './hls_player.js';
import { Source } from './opening.js';
import { Player } from './player.js';

/** @import {Listener} from './player.js' */

/**
 * @typedef {object} Form of all streams of a site
 * @property {string} container mp4 or webm
 * @property {string} codec of the pictures, and after a comma of the sound if there is any
 * @property {number | null} pulse0 unix seconds of media time 0
 * @property {number} gopS seconds of a GOP, which may come all at once
 */

/**
 * @param {HTMLVideoElement} video
 * @param {Listener} listener
 * @returns {Player | HlsPlayer}
 */
export function playerOf(video, listener) {
  return Source ? new Player(video, listener) : new HlsPlayer(video, listener);
}
