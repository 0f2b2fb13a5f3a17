/** The server's decisions, kept for the timeline and the boxes. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Decisions } from '../../../../client/page/timeline/decisions.js';

test('decisions are kept for about a minute, in order and without duplicates', () => {
  const decisions = new Decisions(25);
  const gop = (/** @type {number} */ first, /** @type {string} */ camera) => ({
    first, frames: 10, choices: { 1: camera }, boxes: { [camera]: [[[1, first, 0, 1, 1]]] }, cuts: [],
  });
  for (let n = 1000; n < 6000; n += 10) decisions.add(gop(n, n % 100 < 50 ? 'a' : 'b'));
  decisions.add(gop(5980, 'b'));
  assert.equal(decisions.end, 6000);
  assert.equal(decisions.camera(1, 5999), 'b');
  assert.deepEqual(decisions.boxes('b', 5980), [[1, 5980, 0, 1, 1]]);
  assert.equal(decisions.camera(1, 1000), null, 'too old');
  assert.equal(decisions.camera(1, 6000), null, 'not decided yet');
  assert.equal(decisions.camera(2, 5999), null, 'unknown person');
  assert.deepEqual(decisions.views(1, 5895), [
    { camera: 'b', first: 5895, end: 5900 },
    { camera: 'a', first: 5900, end: 5950 },
    { camera: 'b', first: 5950, end: 6000 },
  ]);
});

test('decisions about a merged number count for the kept one', () => {
  const decisions = new Decisions(25);
  const boxes = { a: [[[4, 1, 2, 3, 4], [2, 0, 0, 1, 1]]] };
  decisions.add({ first: 0, frames: 1, choices: { 4: 'a' }, boxes: /** @type {any} */ (boxes), cuts: [] });
  decisions.add({ first: 1, frames: 1, choices: { 1: 'b' }, boxes: {}, cuts: [] });
  assert.equal(decisions.camera(1, 0), null);
  decisions.rename([{ object: 1, aliases: [4, 7] }, { object: 2 }]);
  assert.equal(decisions.camera(1, 0), 'a');
  assert.deepEqual(decisions.boxes('a', 0), [[1, 1, 2, 3, 4], [2, 0, 0, 1, 1]]);
  assert.deepEqual(decisions.views(1, 0).map((view) => view.camera), ['a', 'b']);
});
