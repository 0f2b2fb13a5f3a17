/** Ignored areas and floor points as configuration and files in the camera's pixels. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import {
  ignoredAreasYaml, missingPoints, pointsFile, toCameraPixels, toSitePixels,
} from '../../../../client/page/operator/marking/mark_export.js';

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

test('complete pairs are in the file, and missing ones are reported', () => {
  /** @type {import('../../../../client/page/operator/marking/mark_export.js').PointPair[]} */
  const pairs = [1, 2, 3].map((at) => ({ image: [at, 0], floor: [String(at), '-0.5'] }));
  const incomplete = { image: /** @type {[number, number]} */ ([9, 9]), floor: /** @type {[string, string]} */ (['1', ' ']) };
  const file = JSON.parse(pointsFile(new Map([['c0', [...pairs, incomplete]], ['c1', [incomplete]]]), 'm'));
  assert.deepEqual(file, {
    unit: 'm',
    cameras: { c0: [1, 2, 3].map((at) => ({ image: [at, 0], floor: [at, -0.5] })) },
  });
  assert.equal(missingPoints('c0', [...pairs, incomplete]), 'c0: 1 of 4 pairs have no position on the floor.');
  assert.match(missingPoints('c0', pairs), /3 of at least 4/);
  assert.equal(missingPoints('c0', [...pairs, pairs[0]]), '');
});
