/** Ignored areas and floor points as configuration and files, in pixels of the camera's own picture. */

/** @import {CameraPicture} from '../api_types.js' */

/** @typedef {[number, number]} Point x and y, pixels */
/** @typedef {{image: Point, floor: [string, string]}} PointPair a point in the camera's picture, and its entered position on the floor */

const MIN_CORNERS = 3;
const MIN_PAIRS = 4;

/**
 * @param {Point} point in the site's picture
 * @param {CameraPicture} picture
 * @returns {Point} in the camera's picture, clamped to it, to a tenth of a pixel
 */
export function toCameraPixels([x, y], { scale, left, top, width, height }) {
  return [clamp((x - left) / scale, width), clamp((y - top) / scale, height)];
}

/**
 * @param {Point} point in the camera's picture
 * @param {CameraPicture} picture
 * @returns {Point} in the site's picture
 */
export function toSitePixels([x, y], { scale, left, top }) {
  return [x * scale + left, y * scale + top];
}

/**
 * @param {number} value
 * @param {number} max
 */
function clamp(value, max) {
  return Math.round(Math.min(max, Math.max(0, value)) * 10) / 10;
}

/**
 * @param {string} camera
 * @param {Point[][]} areas
 * @returns {string} YAML for the configuration; areas with too few corners are left out
 */
export function ignoredAreasYaml(camera, areas) {
  const complete = areas.filter((corners) => corners.length >= MIN_CORNERS);
  const lists = complete.map((corners) => `[${corners.map(([x, y]) => `[${x}, ${y}]`).join(', ')}]`);
  return `cameras:\n  - id: ${camera}\n    ignore: [${lists.join(', ')}]\n`;
}

/**
 * @param {Map<string, PointPair[]>} pairs by camera
 * @param {string} unit of the floor
 * @returns {string} JSON for `myview calibrate`, with the complete pairs
 */
export function pointsFile(pairs, unit) {
  const cameras = [...pairs].map(([camera, all]) => [
    camera,
    all.filter(isComplete).map(({ image, floor }) => ({ image, floor: floor.map(Number) })),
  ]);
  const marked = cameras.filter(([, complete]) => complete.length > 0);
  return `${JSON.stringify({ unit, cameras: Object.fromEntries(marked) }, null, 1)}\n`;
}

/** @param {PointPair} pair */
function isComplete({ floor }) {
  return floor.every((text) => text.trim() !== '' && Number.isFinite(Number(text)));
}

/**
 * @param {string} camera
 * @param {PointPair[]} pairs
 * @returns {string} what is missing; empty: nothing
 */
export function missingPoints(camera, pairs) {
  const complete = pairs.filter(isComplete).length;
  if (complete < pairs.length) return `${camera}: ${pairs.length - complete} of ${pairs.length} pairs have no position on the floor.`;
  if (complete < MIN_PAIRS) return `${camera}: ${complete} of at least ${MIN_PAIRS} pairs; six or more show which one is wrong.`;
  return '';
}
