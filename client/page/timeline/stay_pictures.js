/** Small pictures of people: a frame of the recorded best view, decoded one at a time when its place comes into view. */

import { concat, SegmentSplitter } from '../player/media/mp4.js';
import { openMediaSource } from '../player/media/media_source.js';
import { cropAround } from './stays.js';

/** @import {Box, Gop} from '../shared/api_types.js' */
/** @import {StreamFormat} from '../player/create_player.js' */

const TIMEOUT_MS = 8000;
const INSIDE_S = 0.001; // into the first frame: its exact time may be rounded to before it

/**
 * @typedef {object} StayPicture
 * @property {HTMLCanvasElement} canvas
 * @property {number} object the person
 * @property {number} first the frames [first, end) are a recorded GOP
 * @property {number} end
 */

export class StayPictures {
  /** @type {StayPicture[]} */
  #waiting = [];
  #busy = false;
  /** @type {Map<Element, StayPicture>} */
  #pictures = new Map();
  #observer = new IntersectionObserver((entries) => this.#seen(entries));

  /** @param {() => StreamFormat} format */
  constructor(format) {
    this.format = format;
  }

  /** Forget all pictures. */
  clear() {
    this.#waiting = [];
    this.#pictures.clear();
    this.#observer.disconnect();
  }

  /** @param {StayPicture} picture to draw once its canvas is in view */
  add(picture) {
    this.#pictures.set(picture.canvas, picture);
    this.#observer.observe(picture.canvas);
  }

  /** @param {IntersectionObserverEntry[]} entries */
  #seen(entries) {
    for (const { target, isIntersecting } of entries) {
      const picture = this.#pictures.get(target);
      if (!isIntersecting || picture === undefined) continue;
      this.#observer.unobserve(target);
      this.#waiting.push(picture);
    }
    void this.#drawWaiting();
  }

  async #drawWaiting() {
    if (this.#busy) return;
    this.#busy = true;
    for (let next = this.#waiting.shift(); next; next = this.#waiting.shift()) {
      // Without a picture the stay is still listed.
      await drawFirstFrame(next, this.format()).catch(() => undefined);
    }
    this.#busy = false;
  }
}

/**
 * @param {StayPicture} picture
 * @param {StreamFormat} format
 * @throws {Error} nothing is recorded there, or it cannot be decoded
 */
async function drawFirstFrame({ canvas, object, first, end }, { container, codec }) {
  const span = `?from=p${first}&to=p${end}`;
  const box = await boxOf(object, span);
  const address = `objects/${object}/best.mp4${span}`;
  const response = await request(address);
  const segments = new SegmentSplitter().push(new Uint8Array(await response.arrayBuffer()));
  const start = segments.find(({ kind }) => kind === 'media')?.start;
  if (start === undefined) throw new Error(`${address}: no frame`);
  const video = document.createElement('video');
  video.muted = true;
  try {
    const buffer = await openMediaSource(video, container, codec);
    await buffer.append(concat(segments.map(({ bytes }) => bytes)), start);
    await seek(video, start);
    const { videoWidth: width, videoHeight: height } = video;
    canvas.height = Math.round((canvas.width * height) / width);
    const [left, top, right, bottom] = box ? cropAround(box, width, height) : [0, 0, width, height];
    const context = canvas.getContext('2d');
    context?.drawImage(video, left, top, right - left, bottom - top, 0, 0, canvas.width, canvas.height);
    canvas.classList.add('drawn');
  } finally {
    video.removeAttribute('src');
    video.load();
  }
}

/**
 * @param {number} object
 * @param {string} span of a GOP
 * @returns {Promise<Box | undefined>} the person's box in the first frame of their best view
 */
async function boxOf(object, span) {
  const lines = (await (await request(`api/past${span}`)).text()).split('\n');
  /** @type {Gop} */
  const gop = JSON.parse(lines[0]);
  return gop.boxes[gop.choices[object]]?.[0]?.find(([number]) => number === object);
}

/** @param {string} address relative to the page */
async function request(address) {
  const response = await fetch(address, { signal: AbortSignal.timeout(TIMEOUT_MS) });
  if (!response.ok) throw new Error(`${address}: ${response.status}`);
  return response;
}

/**
 * @param {HTMLVideoElement} video
 * @param {number} time media time, seconds
 * @returns {Promise<void>} when the frame of that time is decoded
 */
function seek(video, time) {
  return new Promise((resolve, reject) => {
    setTimeout(() => reject(new Error('the frame was not decoded')), TIMEOUT_MS);
    video.addEventListener('error', () => reject(new Error('the frame cannot be decoded')), { once: true });
    video.addEventListener('seeked', () => resolve(), { once: true });
    video.currentTime = time + INSIDE_S;
  });
}
