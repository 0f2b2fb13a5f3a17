/** Stills of the cameras, refreshed one after another, and only of visible tiles: the server decodes each on request. */

import { Repeater } from './section.js';

const INTERVAL_MS = 1500;

export class CameraStills {
  /** @type {Map<Element, string>} camera by image */
  #cameras = new Map();
  /** @type {Set<Element>} */
  #visible = new Set();
  #observer = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (isIntersecting) this.#visible.add(target);
      else this.#visible.delete(target);
    }
  });
  #repeater = new Repeater(() => this.#refresh(), INTERVAL_MS, () => undefined); // the tile shows the camera's error

  /**
   * @param {string} camera
   * @param {HTMLImageElement} image
   */
  add(camera, image) {
    this.#cameras.set(image, camera);
    this.#observer.observe(image);
  }

  start() {
    this.#repeater.start();
  }

  stop() {
    this.#repeater.stop();
  }

  async #refresh() {
    for (const image of this.#visible) {
      const camera = this.#cameras.get(image);
      if (camera) await loadStill(/** @type {HTMLImageElement} */ (image), `cameras/${camera}/live.jpg`);
    }
  }
}

/** @type {WeakMap<HTMLImageElement, string>} object URL shown by image */
const shown = new WeakMap();
/** @type {WeakMap<HTMLImageElement, string>} address requested last by image */
const requested = new WeakMap();

/**
 * Load the current still. If there is none, the last one stays, marked as old. An answer is dropped if another
 * still was requested since.
 *
 * @param {HTMLImageElement} image
 * @param {string} address
 * @returns {Promise<boolean>} whether it was loaded
 */
export async function loadStill(image, address) {
  requested.set(image, address);
  const response = await fetch(address, { cache: 'no-store' }).catch(() => null);
  const picture = response?.ok ? await response.blob().catch(() => null) : null;
  if (requested.get(image) !== address) return false;
  image.classList.toggle('old', !picture);
  if (!picture) return false;
  const previous = shown.get(image);
  image.src = URL.createObjectURL(picture);
  shown.set(image, image.src);
  await image.decode().catch(() => undefined);
  if (previous) URL.revokeObjectURL(previous);
  return true;
}
