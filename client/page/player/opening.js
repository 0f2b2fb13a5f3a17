/** What this browser has to be given streams by, and opening it on a video element. */

import { MediaBuffer } from './media/buffer.js';

/** @type {typeof MediaSource | undefined} iPhones have only the managed kind */
export const Source = /** @type {any} */ (globalThis).ManagedMediaSource ?? globalThis.MediaSource;

/**
 * @param {string} container
 * @param {string} codec
 * @returns {boolean} whether this browser can play such streams at all
 */
export function plays(container, codec) {
  return Boolean(Source?.isTypeSupported(mime(container, codec)));
}

/**
 * Take the element for streams of a kind; what it had is dropped.
 *
 * @param {HTMLVideoElement} video
 * @param {string} container
 * @param {string} codec
 * @returns {Promise<MediaBuffer>} what they are written into
 */
export async function opened(video, container, codec) {
  const source = new /** @type {typeof MediaSource} */ (Source)();
  const address = URL.createObjectURL(source);
  video.src = address;
  await new Promise((resolve) => source.addEventListener('sourceopen', resolve, { once: true }));
  URL.revokeObjectURL(address);
  return new MediaBuffer(source.addSourceBuffer(mime(container, codec)));
}

/**
 * @param {string} container
 * @param {string} codec
 */
function mime(container, codec) {
  return `video/${container}; codecs="${codec}"`;
}
