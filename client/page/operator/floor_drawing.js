/** Drawings of the floor: the area that each camera covers, and people's tracks. The y axis of a drawing points down. */

import { shortLabel } from '../people/names.js';
import { svg } from '../shared/dom.js';
import { svgPoints } from './floor_tracks.js';

/** @import {Floor} from './api_types.js' */
/** @import {FloorTrack} from './floor_tracks.js' */
/** @import {Palette} from '../people/palette.js' */

const MARGIN = 0.05; // share of the plan's size
const DOT = 0.012; // likewise

/**
 * @typedef {object} Coverage
 * @property {string} viewBox of the drawing
 * @property {number} size of the larger side of what is covered, in the floor's unit
 * @property {Element[]} areas one for each camera
 */

/**
 * @param {Floor} floor
 * @param {Palette} palette
 * @returns {Coverage | null} null: no camera is calibrated, or none has reported yet
 */
export function drawCoverage({ cameras }, palette) {
  const corners = cameras.flatMap(({ outline }) => outline);
  if (!corners.length) return null;
  const [left, right] = range(corners.map(([x]) => x));
  const [low, high] = range(corners.map(([, y]) => -y));
  const size = Math.max(right - left, high - low);
  const margin = size * MARGIN;
  const areas = cameras.map(({ camera, outline }) => {
    const color = palette.color(camera);
    return svg('polygon', { points: svgPoints(outline), fill: color, stroke: color, class: 'coverage' });
  });
  return { viewBox: [left - margin, low - margin, right - left + 2 * margin, high - low + 2 * margin].join(' '), size, areas };
}

/**
 * @param {FloorTrack} track
 * @param {number} size of the plan
 */
export function drawTrack({ object, positions }, size) {
  const [x, y] = positions[positions.length - 1];
  const name = svg('text', { x, y: -y - size * DOT * 1.6, 'font-size': size * 0.035, class: 'name' });
  name.textContent = shortLabel(object);
  return [
    svg('polyline', { points: svgPoints(positions), class: 'track' }),
    svg('circle', { cx: x, cy: -y, r: size * DOT, class: 'dot' }),
    name,
  ];
}

/**
 * @param {number} calibrated number of calibrated cameras
 * @param {string[]} uncalibrated
 * @returns {string} what is missing; empty: nothing
 */
export function describeCalibration(calibrated, uncalibrated) {
  if (calibrated) return uncalibrated.length ? `Not calibrated: ${uncalibrated.join(', ')}.` : '';
  if (!uncalibrated.length) return 'No camera has reported yet.';
  return 'No camera is calibrated: calibrate by walking, or by points.';
}

/** @param {number[]} values */
function range(values) {
  return [Math.min(...values), Math.max(...values)];
}
