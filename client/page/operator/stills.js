/**
 * Pictures of the cameras, one after the other: the server decodes for each that is asked for, so that only
 * those are that somebody can see.
 */

import { Repeated } from './section.js';

const EVERY_MS = 1500;

export class Stills {
  /** @type {Map<Element, string>} the pictures' cameras */
  #cameras = new Map();
  /** @type {Set<Element>} */
  #seen = new Set();
  #watch = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (isIntersecting) this.#seen.add(target);
      else this.#seen.delete(target);
    }
  });
  #repeated = new Repeated(() => this.#round(), EVERY_MS, () => undefined); // a tile says why there is none

  /**
   * @param {string} camera
   * @param {HTMLImageElement} image
   */
  add(camera, image) {
    this.#cameras.set(image, camera);
    this.#watch.observe(image);
  }

  start() {
    this.#repeated.start();
  }

  stop() {
    this.#repeated.stop();
  }

  async #round() {
    for (const image of this.#seen) {
      const camera = this.#cameras.get(image);
      if (camera) await load(/** @type {HTMLImageElement} */ (image), `cameras/${camera}/live.jpg`);
    }
  }
}

/** @type {WeakMap<HTMLImageElement, string>} addresses of what is shown */
const shown = new WeakMap();
/** @type {WeakMap<HTMLImageElement, string>} what was asked for last */
const wanted = new WeakMap();

/**
 * Shows a picture of now; where there is none, the last one stays, marked as old. An answer that comes after
 * another camera's picture was asked for is not shown.
 *
 * @param {HTMLImageElement} image
 * @param {string} address
 * @returns {Promise<boolean>} there is one
 */
export async function load(image, address) {
  wanted.set(image, address);
  const response = await fetch(address, { cache: 'no-store' }).catch(() => null);
  const picture = response?.ok ? await response.blob().catch(() => null) : null;
  if (wanted.get(image) !== address) return false;
  image.classList.toggle('old', !picture);
  if (!picture) return false;
  const before = shown.get(image);
  image.src = URL.createObjectURL(picture);
  shown.set(image, image.src);
  await image.decode().catch(() => undefined);
  if (before) URL.revokeObjectURL(before);
  return true;
}
