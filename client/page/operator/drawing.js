/** What is drawn on a camera's picture, and the lines and files that it becomes. Places are in pixels. */

/** @import {OwnPicture} from './contract.js' */

/** @typedef {[number, number]} Place x and y */
/** @typedef {{image: Place, floor: [string, string]}} Pair a place in the camera's own picture, and what was entered */

const LEAST_CORNERS = 3;
const LEAST_PAIRS = 4;

/**
 * @param {Place} site a place in the site's picture
 * @param {OwnPicture} picture
 * @returns {Place} in the camera's own, within it, to a tenth of a pixel
 */
export function toOwn([x, y], { scale, left, top, width, height }) {
  return [within((x - left) / scale, width), within((y - top) / scale, height)];
}

/**
 * @param {Place} own
 * @param {OwnPicture} picture
 * @returns {Place}
 */
export function toSite([x, y], { scale, left, top }) {
  return [x * scale + left, y * scale + top];
}

/**
 * @param {number} value
 * @param {number} most
 */
function within(value, most) {
  return Math.round(Math.min(most, Math.max(0, value)) * 10) / 10;
}

/**
 * @param {string} camera
 * @param {Place[][]} shapes
 * @returns {string} of a configuration; shapes that are no areas are left out
 */
export function ignoreLines(camera, shapes) {
  const whole = shapes.filter((it) => it.length >= LEAST_CORNERS);
  const lists = whole.map((shape) => `[${shape.map(([x, y]) => `[${x}, ${y}]`).join(', ')}]`);
  return `cameras:\n  - id: ${camera}\n    ignore: [${lists.join(', ')}]\n`;
}

/**
 * @param {Map<string, Pair[]>} pairs by camera
 * @param {string} unit of the floor
 * @returns {string} JSON for myview calibrate: pairs that are whole
 */
export function pointsFile(pairs, unit) {
  const cameras = [...pairs].map(([camera, all]) => [camera, all.filter(isWhole).map(({ image, floor }) => ({ image, floor: floor.map(Number) }))]);
  const known = cameras.filter(([, all]) => all.length > 0);
  return `${JSON.stringify({ unit, cameras: Object.fromEntries(known) }, null, 1)}\n`;
}

/** @param {Pair} pair */
function isWhole({ floor }) {
  return floor.every((it) => it.trim() !== '' && Number.isFinite(Number(it)));
}

/**
 * @param {string} camera
 * @param {Pair[]} pairs
 * @returns {string} what is still missing; empty: nothing
 */
export function missing(camera, pairs) {
  const whole = pairs.filter(isWhole).length;
  if (whole < pairs.length) return `${camera}: ${pairs.length - whole} of ${pairs.length} pairs have no place on the floor.`;
  if (whole < LEAST_PAIRS) return `${camera}: ${whole} of at least ${LEAST_PAIRS} pairs; six or more show which one is wrong.`;
  return '';
}
