/**
 * Plays live pictures by WebRTC (WHEP), for ?transport=webrtc: each as soon as it arrives, without a buffer to fill.
 *
 * Its times have an origin of their own, so that frames are not mapped to pulses: there are no boxes, and no past.
 */

import { Backoff } from '../shared/backoff.js';
import { pause } from '../shared/requests.js';
import { Playback } from './playback.js';
import { isSameSelection } from './stream_selection.js';

/** @import {PlayerListener} from './mse_player.js' */
/** @import {StreamFormat} from './create_player.js' */
/** @import {StreamSelection} from './stream_selection.js' */

const GATHER_MS = 1000; // for the browser's own addresses

/** @returns {boolean} whether the page's address asks for WebRTC, and the browser has it */
export function wantsWebRtc() {
  return new URLSearchParams(location.search).get('transport') === 'webrtc' && 'RTCPeerConnection' in globalThis;
}

export class WebRtcPlayer {
  /** @type {StreamSelection | null} what the element displays */
  shown = null;
  /** @type {StreamSelection | null} */
  #selection = null;
  /** @type {RTCPeerConnection | null} */
  #connection = null;
  /** @type {string | null} the address of the session, by which it is ended */
  #session = null;
  #backoff = new Backoff();
  #playback;

  /**
   * @param {HTMLVideoElement} video
   * @param {PlayerListener} listener
   */
  constructor(video, listener) {
    this.video = video;
    this.listener = listener;
    this.#playback = new Playback(video, () => this.shown && !this.isSwitching() && listener.resumed());
    video.addEventListener('loadeddata', () => this.#loaded());
  }

  /**
   * @param {StreamFormat} format
   * @returns {boolean} whether this browser can play the format
   */
  configure({ codec, transcoded }) {
    return codec.startsWith('avc') && !transcoded;
  }

  /** @param {StreamSelection} selection to play from now on */
  select(selection) {
    if (this.#selection && isSameSelection(this.#selection, selection)) return;
    if (selection.past) return this.listener.ended(true);
    this.#selection = selection;
    void this.#load();
  }

  play() {
    this.#playback.start();
  }

  /** @returns {boolean} whether the element may still display the previous selection */
  isSwitching() {
    return this.#selection !== null && this.#selection !== this.shown;
  }

  /** @returns {number} NaN: unknown */
  mediaTime() {
    return NaN;
  }

  /** Stop playing; the last frame stays. */
  stop() {
    this.video.pause();
    this.#selection = null;
    this.#disconnect();
  }

  /** Release the stream and the element. */
  close() {
    this.stop();
    this.video.srcObject = null;
  }

  async #load() {
    const selection = this.#selection;
    if (!selection) return;
    this.#disconnect();
    const connection = (this.#connection = new RTCPeerConnection());
    connection.addTransceiver('video', { direction: 'recvonly' });
    connection.addEventListener('track', ({ receiver, track }) => {
      if ('jitterBufferTarget' in receiver) receiver.jitterBufferTarget = 0;
      this.video.srcObject = new MediaStream([track]);
      this.play();
    });
    connection.addEventListener('connectionstatechange', () => {
      if (connection === this.#connection && ['disconnected', 'failed'].includes(connection.connectionState)) void this.#retry();
    });
    try {
      await connection.setLocalDescription();
      await gathered(connection);
      const answer = await fetch(whepUrl(selection), {
        method: 'POST',
        headers: { 'Content-Type': 'application/sdp' },
        body: connection.localDescription?.sdp,
      });
      if (!answer.ok) throw new Error(`${answer.status}`);
      const session = answer.headers.get('Location');
      const sdp = await answer.text();
      if (connection !== this.#connection) return end(session);
      this.#session = session;
      await connection.setRemoteDescription({ type: 'answer', sdp });
    } catch {
      if (connection === this.#connection) void this.#retry();
    }
  }

  #loaded() {
    this.#backoff.reset();
    this.shown = this.#selection;
    if (this.shown) this.listener.switched();
  }

  #disconnect() {
    this.#connection?.close();
    end(this.#session);
    this.#connection = this.#session = null;
  }

  async #retry() {
    const selection = this.#selection;
    this.#disconnect();
    await pause(this.#backoff.next());
    if (selection === this.#selection) void this.#load();
  }
}

/**
 * @param {StreamSelection} selection its preferred camera is ignored
 * @returns {string} address relative to the page
 */
function whepUrl({ object, camera, delay }) {
  if (camera !== null) return `cameras/${encodeURIComponent(camera)}/whep`;
  return `objects/${object}/whep${delay ? `?delay=${delay}` : ''}`;
}

/** @param {RTCPeerConnection} connection */
async function gathered(connection) {
  if (connection.iceGatheringState === 'complete') return;
  const done = new AbortController();
  connection.addEventListener('icegatheringstatechange', () => {
    if (connection.iceGatheringState === 'complete') done.abort();
  });
  await pause(GATHER_MS, done.signal);
}

/** @param {string | null} session its address, whose path a proxy may have put below another one */
function end(session) {
  if (session) void fetch(session.replace(/^.*?((objects|cameras)\/)/, '$1'), { method: 'DELETE', keepalive: true }).catch(() => undefined);
}
