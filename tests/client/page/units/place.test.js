/** Where people stand on the floor, by what all cameras say. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { place, Ways } from '../../../../client/page/operator/positions.js';

const SITE = { fps: 10, height: 100 };
const PLAN = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const SHIFTED = [[1, 0, 4], [0, 1, 0], [0, 0, 1]];
const HORIZON = [[1, 0, 0], [0, 1, 0], [0, 0.1, -5]]; // the third is 0 where y is 50
const CAMERAS = [
  { camera: 'a', homography: PLAN, outline: [] },
  { camera: 'b', homography: SHIFTED, outline: [] },
];

/**
 * @param {number} first
 * @param {Record<string, number[][]>} boxes in each of ten frames
 * @param {object} [more]
 */
function gop(first, boxes, more = {}) {
  const frames = Object.fromEntries(Object.entries(boxes).map(([camera, it]) => [camera, Array(10).fill(it)]));
  return /** @type {any} */ ({ first, frames: 10, boxes: frames, ...more });
}

test('a place is where the homography leads, and nowhere above the horizon', () => {
  assert.deepEqual(place(HORIZON, 10, 60), [10, 60]);
  assert.equal(place(HORIZON, 10, 50), null);
  assert.equal(place(HORIZON, 10, 40), null);
});

test('who several cameras see stands between where they see them', () => {
  const ways = new Ways(SITE);
  ways.add(gop(0, { a: [[1, 10, 0, 20, 50]], b: [[1, 10, 0, 20, 50]], none: [[9, 0, 0, 1, 1]] }), CAMERAS);
  const [walker, ...others] = ways.walkers;
  assert.deepEqual(others, []);
  assert.deepEqual(walker.way.at(-1), [17, 50]);
  assert.equal(walker.way.length, 5); // of ten frames, at ten a second, five places
  assert.deepEqual(walker.cameras, ['a', 'b']);
});

test('feet that the edge cuts off are nowhere', () => {
  const ways = new Ways(SITE);
  ways.add(gop(0, { a: [[1, 10, 0, 20, 100], [2, 10, 0, 20, 90]] }), CAMERAS);
  assert.deepEqual(ways.walkers.map(({ object }) => object), [2]);
});

test('what was said twice counts once, what is old is forgotten, and a merged way goes on', () => {
  const ways = new Ways(SITE);
  const boxes = { a: [[1, 0, 0, 10, 50]] };
  ways.add(gop(0, boxes), CAMERAS);
  ways.add(gop(0, boxes), CAMERAS);
  assert.equal(ways.walkers[0].way.length, 5);
  ways.add(gop(10, { a: [[2, 0, 0, 10, 50]] }, { merged: [{ kept: 2, lost: 1 }] }), CAMERAS);
  assert.deepEqual(ways.walkers.map(({ object, way }) => [object, way.length]), [[2, 10]]);
  ways.add(gop(200, {}), CAMERAS);
  assert.deepEqual(ways.walkers, []);
});

test('pulses that begin anew are another time', () => {
  const ways = new Ways(SITE);
  ways.add(gop(1000, { a: [[1, 0, 0, 10, 50]] }), CAMERAS);
  ways.add(gop(0, { a: [[3, 0, 0, 10, 50]] }), CAMERAS);
  assert.deepEqual(ways.walkers.map(({ object, way }) => [object, way.length]), [[3, 5]]);
});
