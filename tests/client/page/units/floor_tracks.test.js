/** People's tracks on the floor. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { FloorTracks, projectToFloor } from '../../../../client/page/operator/floor_tracks.js';

const SITE = { fps: 10, height: 100 };
const PLAN = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const SHIFTED = [[1, 0, 4], [0, 1, 0], [0, 0, 1]];
const HORIZON = [[1, 0, 0], [0, 1, 0], [0, 0.1, -5]]; // the third coordinate is 0 at y = 50
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
  const frames = Object.fromEntries(Object.entries(boxes).map(([camera, frame]) => [camera, Array(10).fill(frame)]));
  return /** @type {any} */ ({ first, frames: 10, boxes: frames, ...more });
}

test('points are projected by the homography; above the horizon there is no position', () => {
  assert.deepEqual(projectToFloor(HORIZON, 10, 60), [10, 60]);
  assert.equal(projectToFloor(HORIZON, 10, 50), null);
  assert.equal(projectToFloor(HORIZON, 10, 40), null);
});

test('positions of several cameras are averaged', () => {
  const tracks = new FloorTracks(SITE);
  tracks.add(gop(0, { a: [[1, 10, 0, 20, 50]], b: [[1, 10, 0, 20, 50]], none: [[9, 0, 0, 1, 1]] }), CAMERAS);
  const [track, ...others] = tracks.tracks;
  assert.deepEqual(others, []);
  assert.deepEqual(track.positions.at(-1), [17, 50]);
  assert.equal(track.positions.length, 5); // ten frames at ten per second give five positions
  assert.deepEqual(track.cameras, ['a', 'b']);
});

test('feet cut off by the lower edge have no position', () => {
  const tracks = new FloorTracks(SITE);
  tracks.add(gop(0, { a: [[1, 10, 0, 20, 100], [2, 10, 0, 20, 90]] }), CAMERAS);
  assert.deepEqual(tracks.tracks.map(({ object }) => object), [2]);
});

test('repeated GOPs count once, merged tracks continue, old positions are deleted', () => {
  const tracks = new FloorTracks(SITE);
  const boxes = { a: [[1, 0, 0, 10, 50]] };
  tracks.add(gop(0, boxes), CAMERAS);
  tracks.add(gop(0, boxes), CAMERAS);
  assert.equal(tracks.tracks[0].positions.length, 5);
  tracks.add(gop(10, { a: [[2, 0, 0, 10, 50]] }, { merged: [{ kept: 2, lost: 1 }] }), CAMERAS);
  assert.deepEqual(tracks.tracks.map(({ object, positions }) => [object, positions.length]), [[2, 10]]);
  tracks.add(gop(200, {}), CAMERAS);
  assert.deepEqual(tracks.tracks, []);
});

test('restarted pulses delete all tracks', () => {
  const tracks = new FloorTracks(SITE);
  tracks.add(gop(1000, { a: [[1, 0, 0, 10, 50]] }), CAMERAS);
  tracks.add(gop(0, { a: [[3, 0, 0, 10, 50]] }), CAMERAS);
  assert.deepEqual(tracks.tracks.map(({ object, positions }) => [object, positions.length]), [[3, 5]]);
});
