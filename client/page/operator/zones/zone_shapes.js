/** Shapes of zones: areas and lines with a direction, and the places that they are drawn on. */

import { toCameraPixels, toSitePixels } from '../marking/camera_pixels.js';

/** @import {CameraPicture, SiteZone} from '../api_types.js' */

/** @typedef {[number, number]} Point x and y */

/**
 * @typedef {object} Shape
 * @property {'area' | 'line'} kind
 * @property {Point[]} corners of an area, in order; of a line its two ends
 * @property {Point | null} inner a point on the inner side of a line
 */

/**
 * @typedef {object} Place where zones are drawn: the floor, or a camera's picture
 * @property {string | null} camera null: the floor
 * @property {string} unit
 * @property {number} size of the drawing
 * @property {Point} center of the drawing, as coordinates of zones
 * @property {(point: Point) => Point} toDrawing from coordinates of zones
 * @property {(point: Point) => Point} fromDrawing to coordinates of zones, rounded
 */

const ARROW = 0.25; // its length, as a share of the line's

/**
 * @param {string} viewBox of the plan, in the floor's unit
 * @param {number} scale units of the floor per unit of zones
 * @param {number} size of the plan
 * @param {string} unit of zones
 * @returns {Place}
 */
export function floorPlace(viewBox, scale, size, unit) {
  const decimals = Math.min(6, Math.max(0, 3 - Math.round(Math.log10(size / scale))));
  const [left, top, width, height] = viewBox.split(' ').map(Number);
  /** @param {Point} point @returns {Point} */
  const fromDrawing = ([x, y]) => [round(x / scale, decimals), round(-y / scale, decimals)];
  return {
    camera: null,
    unit,
    size,
    center: fromDrawing([left + width / 2, top + height / 2]),
    toDrawing: ([x, y]) => [x * scale, -y * scale],
    fromDrawing,
  };
}

/**
 * @param {string} camera
 * @param {CameraPicture} picture
 * @param {number} width of the site's picture
 * @returns {Place}
 */
export function picturePlace(camera, picture, width) {
  return {
    camera,
    unit: 'pixels',
    size: width,
    center: [Math.round(picture.width / 2), Math.round(picture.height / 2)],
    toDrawing: (point) => toSitePixels(point, picture),
    fromDrawing: (point) => toCameraPixels(point, picture),
  };
}

/**
 * @param {SiteZone} zone
 * @returns {Shape} a copy
 */
export function shapeOf({ area, line, inner }) {
  return { kind: line ? 'line' : 'area', corners: (area ?? line ?? []).map(([x, y]) => [x, y]), inner: inner && [...inner] };
}

/**
 * Add a corner where a point was pressed: at the end of a new shape, else in the nearest edge.
 *
 * @param {Shape} shape
 * @param {Point} point
 * @param {boolean} isNew
 */
export function addCorner(shape, point, isNew) {
  const { corners } = shape;
  if (shape.kind === 'line') {
    if (corners.length < 2) corners.push(point);
    if (corners.length === 2) shape.inner ??= besideLine(corners, 1);
  } else corners.splice(isNew || corners.length < 3 ? corners.length : nearestEdge(corners, point) + 1, 0, point);
}

/**
 * @param {Point[]} corners three or more
 * @param {Point} point
 * @returns {number} index of the corner at which the nearest edge starts
 */
export function nearestEdge(corners, point) {
  const distances = corners.map((corner, at) => distance(point, corner, corners[(at + 1) % corners.length]));
  return distances.indexOf(Math.min(...distances));
}

/**
 * Move a corner of a shape; -1 is the inner point of a line, which moves along when its line does.
 *
 * @param {Shape} shape
 * @param {number} index
 * @param {Point} point
 */
export function moveCorner(shape, index, point) {
  if (index < 0) shape.inner = point;
  else shape.corners[index] = point;
  if (index >= 0 && shape.kind === 'line' && shape.inner) shape.inner = besideLine(shape.corners, innerSide(shape.corners, shape.inner));
}

/** @param {Shape} shape a line; its inner side becomes the outer one */
export function turnDirection(shape) {
  if (shape.inner) shape.inner = besideLine(shape.corners, -innerSide(shape.corners, shape.inner));
}

/**
 * @param {Point[]} line
 * @param {Point} inner
 * @returns {number} 1: left of the line where the y axis points up; -1: right
 */
function innerSide([[x, y], [x2, y2]], [px, py]) {
  return (x2 - x) * (py - y) - (y2 - y) * (px - x) < 0 ? -1 : 1;
}

/**
 * @param {Point[]} line
 * @param {number} side 1 or -1
 * @returns {Point} beside its middle
 */
function besideLine([[x, y], [x2, y2]], side) {
  const [across, down] = [x2 - x, y2 - y];
  return [round((x + x2) / 2 - side * ARROW * down, 3), round((y + y2) / 2 + side * ARROW * across, 3)];
}

/**
 * @param {Point} point
 * @param {Point} start of a segment
 * @param {Point} end
 */
function distance([px, py], [x, y], [x2, y2]) {
  const length = (x2 - x) ** 2 + (y2 - y) ** 2;
  const share = length === 0 ? 0 : Math.min(1, Math.max(0, ((px - x) * (x2 - x) + (py - y) * (y2 - y)) / length));
  return Math.hypot(px - x - share * (x2 - x), py - y - share * (y2 - y));
}

/**
 * @param {number} value
 * @param {number} decimals
 */
function round(value, decimals) {
  const scale = 10 ** decimals;
  return Math.round(value * scale) / scale || 0; // no negative zero
}
