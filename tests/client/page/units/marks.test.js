/** Ignored areas as configuration, and places on the floor as files, in the camera's pixels. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { describeCoordinate, PointMarks, readNumber, toFloor } from '../../../../client/page/operator/calibration/point_marks.js';
import { ignoredAreasYaml, toCameraPixels, toSitePixels } from '../../../../client/page/operator/marking/camera_pixels.js';

const PICTURE = { width: 1280, height: 960, scale: 0.375, left: 80, top: 0 };

test('conversions are inverse, and points outside the picture are clamped', () => {
  for (const point of /** @type {[number, number][]} */ ([[0, 0], [1280, 960], [640.5, 17.2]])) {
    assert.deepEqual(toCameraPixels(toSitePixels(point, PICTURE), PICTURE), point);
  }
  assert.deepEqual(toCameraPixels([0, 400], PICTURE), [0, 960]);
});

test('areas with too few corners are left out', () => {
  const yaml = ignoredAreasYaml('door', [[[0, 0], [90, 0], [90, 40.5]], [[1, 1], [2, 2]], []]);
  assert.equal(yaml, 'cameras:\n  - id: door\n    ignore: [[[0, 0], [90, 0], [90, 40.5]]]\n');
  assert.equal(ignoredAreasYaml('door', []), 'cameras:\n  - id: door\n    ignore: []\n');
});

test('a place that two cameras see has one position, and places without one are not in the file', () => {
  const marks = new PointMarks();
  for (const at of [0, 1, 2]) marks.mark('c0', undefined, [at, 0]);
  marks.mark('c1', marks.places[1], [9, 9.5]);
  marks.places[1].position = ['1,5', ' -2 '];
  assert.deepEqual(marks.toFile('m'), {
    unit: 'm',
    cameras: {
      c0: [{ image: [1, 0], floor: [1.5, -2], name: 'place 2' }],
      c1: [{ image: [9, 9.5], floor: [1.5, -2], name: 'place 2' }],
    },
  });
  assert.match(marks.describeMissing('c0'), /3 of at least 4/);
  marks.mark('c0', undefined, [3, 0]);
  assert.equal(marks.describeMissing('c0'), '');
});

test('undo removes the last mark of a camera, and a place without marks and position', () => {
  const marks = new PointMarks();
  marks.mark('c0', undefined, [1, 1]);
  marks.mark('c1', undefined, [2, 2]);
  marks.places[1].position = ['1', ''];
  marks.mark('c0', marks.places[1], [3, 3]);
  marks.mark('c0', marks.places[0], [4, 4]); // moved: it is the last one now
  marks.undo('c0');
  assert.deepEqual(marks.seenBy('c0').map(({ seen }) => seen.get('c0')), [[3, 3]]);
  marks.clear('c0');
  marks.undo('c1');
  assert.deepEqual(marks.places.map(({ position }) => position), [['1', '']]);
  marks.undo('c1');
  assert.equal(marks.places.length, 1);
});

test('marks are the same after they were loaded from a file, or saved and restored', () => {
  /** @type {import('../../../../client/page/operator/api_types.js').PointsFile['cameras']} */
  const cameras = {
    c0: [{ image: [1, 2], floor: [0, 0] }, { image: [1.5, 2], floor: [0, 0] }, { image: [3, 4], floor: [2.5, 1] }],
    c1: [{ image: [5, 6], floor: [2.5, 1] }, { image: [7, 8], floor: [0, 0] }],
  };
  const marks = new PointMarks();
  marks.load(cameras);
  assert.deepEqual(marks.places.map(({ seen }) => [...seen.keys()]), [['c0', 'c1'], ['c0'], ['c0', 'c1']]);
  const restored = new PointMarks();
  restored.restore(JSON.parse(JSON.stringify(marks.save())), ['c0', 'c1']);
  assert.deepEqual(restored.toFile('m'), marks.toFile('m'));
  restored.restore(JSON.parse(JSON.stringify(marks.save())), ['c1']);
  assert.deepEqual(Object.keys(restored.toFile('m').cameras), ['c1']);
});

test('numbers have a point or a comma, and what is none is described', () => {
  assert.deepEqual(['2,5', ' -1e2 ', '0'].map(readNumber), [2.5, -100, 0]);
  assert.deepEqual(['', ' ', 'x', 'NaN', '1e400', '1,2,3', '2e9', '-0.5'].map((text) => describeCoordinate(text).split(' ')[0]), [
    'Enter', 'Enter', 'Enter', 'Enter', 'Enter', 'Enter', 'This', '',
  ]);
});

test('a pixel is mapped to the floor, but not above the horizon', () => {
  const homography = [[0.1, 0, 0], [0, 0.1, 0], [0, 0.01, -1]];
  assert.deepEqual(toFloor(homography, [10, 200]), [1, 20]);
  assert.equal(toFloor(homography, [10, 50]), null);
  assert.deepEqual(toFloor(homography.map((row) => row.map((value) => -value)), [10, 200]), [1, 20]);
});
