/** Shapes of zones: corners are added and moved, lines have a direction, and places convert coordinates. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import {
  addCorner, floorPlace, moveCorner, nearestEdge, picturePlace, shapeOf, turnDirection,
} from '../../../../client/page/operator/zones/zone_shapes.js';

/** @import {Point, Shape} from '../../../../client/page/operator/zones/zone_shapes.js' */

/** @type {Point[]} */
const SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]];

/** @param {Partial<Shape>} given @returns {Shape} */
function shape(given) {
  return { kind: 'area', corners: [], inner: null, ...given };
}

test('places convert to the drawing and back; the y axis of the floor points up', () => {
  const floor = floorPlace('0 -1000 2000 1000', 100, 2000, 'm');
  assert.deepEqual(floor.toDrawing([3, 2]), [300, -200]);
  assert.deepEqual(floor.fromDrawing([300, -200]), [3, 2]);
  assert.deepEqual(floor.fromDrawing([123.4567, 0]), [1.23, 0]);
  assert.deepEqual(floor.center, [10, 5]);
  const picture = picturePlace('c0', { width: 1280, height: 960, scale: 0.375, left: 80, top: 0 }, 640);
  assert.deepEqual(picture.fromDrawing(picture.toDrawing([640.5, 17.2])), [640.5, 17.2]);
  assert.deepEqual([picture.camera, picture.center], ['c0', [640, 480]]);
});

test('corners of a new area are in the order of the presses, those of another one in the nearest edge', () => {
  const area = shape({});
  for (const corner of SQUARE) addCorner(area, corner, true);
  assert.deepEqual(area.corners, SQUARE);
  addCorner(area, [5, 2], false);
  assert.deepEqual(area.corners[2], [5, 2]);
  addCorner(area, [-1, 2], false);
  assert.deepEqual(area.corners[5], [-1, 2]);
  assert.equal(nearestEdge(SQUARE, [2, 4.1]), 2);
});

test('a line has two ends, and its inner side can be turned and moves along', () => {
  const line = shape({ kind: 'line' });
  for (const end of /** @type {Point[]} */ ([[0, 0], [4, 0], [9, 9]])) addCorner(line, end, true);
  assert.deepEqual(line, { kind: 'line', corners: [[0, 0], [4, 0]], inner: [2, 1] });
  turnDirection(line);
  assert.deepEqual(line.inner, [2, -1]);
  moveCorner(line, 1, [0, 8]);
  assert.deepEqual(line.inner, [2, 4]);
  moveCorner(line, -1, [-3, 4]);
  assert.deepEqual(line.inner, [-3, 4]);
  turnDirection(line);
  assert.deepEqual(line.inner, [2, 4]);
});

test('a shape is a copy of its zone', () => {
  const zone = { zone: 'a', camera: null, area: SQUARE, line: null, inner: null, rules: [] };
  const copied = shapeOf(zone);
  moveCorner(copied, 0, [9, 9]);
  assert.deepEqual([copied.kind, zone.area[0]], ['area', [0, 0]]);
  assert.deepEqual(shapeOf({ ...zone, area: null, line: [[0, 0], [1, 0]], inner: [1, 1] }).inner, [1, 1]);
});
