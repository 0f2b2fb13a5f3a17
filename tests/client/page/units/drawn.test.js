/** What is drawn on a camera's picture becomes lines and files in the camera's own pixels. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { ignoreLines, missing, pointsFile, toOwn, toSite } from '../../../../client/page/operator/drawing.js';

const PICTURE = { width: 1280, height: 960, scale: 0.375, left: 80, top: 0 };

test('there and back is the same place, and what is beside the picture is its edge', () => {
  for (const own of /** @type {[number, number][]} */ ([[0, 0], [1280, 960], [640.5, 17.2]])) {
    assert.deepEqual(toOwn(toSite(own, PICTURE), PICTURE), own);
  }
  assert.deepEqual(toOwn([0, 400], PICTURE), [0, 960]);
});

test('shapes without an area are left out', () => {
  const lines = ignoreLines('door', [[[0, 0], [90, 0], [90, 40.5]], [[1, 1], [2, 2]], []]);
  assert.equal(lines, 'cameras:\n  - id: door\n    ignore: [[[0, 0], [90, 0], [90, 40.5]]]\n');
  assert.equal(ignoreLines('door', []), 'cameras:\n  - id: door\n    ignore: []\n');
});

test('pairs that are whole are in the file, and what is missing is said', () => {
  /** @type {import('../../../../client/page/operator/drawing.js').Pair[]} */
  const pairs = [1, 2, 3].map((at) => ({ image: [at, 0], floor: [String(at), '-0.5'] }));
  const half = { image: /** @type {[number, number]} */ ([9, 9]), floor: /** @type {[string, string]} */ (['1', ' ']) };
  const file = JSON.parse(pointsFile(new Map([['c0', [...pairs, half]], ['c1', [half]]]), 'm'));
  assert.deepEqual(file, {
    unit: 'm',
    cameras: { c0: [1, 2, 3].map((at) => ({ image: [at, 0], floor: [at, -0.5] })) },
  });
  assert.equal(missing('c0', [...pairs, half]), 'c0: 1 of 4 pairs have no place on the floor.');
  assert.match(missing('c0', pairs), /3 of at least 4/);
  assert.equal(missing('c0', [...pairs, pairs[0]]), '');
});
