/** Pixels of a camera's own picture, and areas in them as configuration. */

/** @import {CameraPicture} from '../api_types.js' */

/** @typedef {[number, number]} Point x and y, pixels */

const MIN_CORNERS = 3;

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
