import assert from 'node:assert/strict';
import test from 'node:test';

import { cropAround, duration, joinStays, searchAddress } from '../../../../client/page/timeline/stays.js';
import { spanOf } from '../../../../client/page/timeline/past_search.js';

const FPS = 10;

/** @param {number} first @param {number} frames @param {object} [more] */
function stay(first, frames, more = {}) {
  const nothing = { run: null, name: null, zone: null, camera: null, begins: null, cameras: [], clip: null };
  return { object: 1, ...nothing, first, frames, seconds: frames / FPS, ...more };
}

test('the address of a search names zones, cameras, or neither', () => {
  const question = { from: '-3600', to: null, place: 'anywhere', object: null };
  assert.equal(searchAddress(question, 'newest'), 'api/past/search?from=-3600&order=newest&limit=200');
  const asked = (/** @type {object} */ changes) => new URL(searchAddress({ ...question, ...changes }, 'time'), 'http://x').searchParams;
  assert.equal(asked({ place: 'zone:a:b' }).get('zone'), 'a:b');
  assert.equal(asked({ place: 'camera:c 1' }).get('camera'), 'c 1');
  assert.deepEqual([asked({ place: 'places' }).get('zone'), asked({ place: 'places' }).get('camera')], ['*', '*']);
  assert.deepEqual([asked({ place: 'zones' }).get('camera'), asked({ place: 'cameras' }).get('zone')], [null, null]);
  assert.equal(asked({ object: 0, to: 'p9' }).get('object'), '0');
});

test('stays that the end of an answer has cut are joined, and no others', () => {
  const cut = [stay(0, 100), stay(50, 5, { camera: 'c1' }), stay(130, 20), stay(181, 10), stay(150, 10, { object: 2 })];
  const joined = joinStays(cut, 'time', FPS);
  assert.deepEqual(joined.map(({ first, frames, seconds }) => [first, frames, seconds]), [
    [0, 150, 15], [50, 5, 0.5], [150, 10, 1], [181, 10, 1],
  ]);
  assert.deepEqual(joinStays(cut, 'newest', FPS).map(({ first }) => first), [181, 150, 50, 0]);
  assert.deepEqual(joinStays(cut, 'longest', FPS).map(({ frames }) => frames), [150, 10, 10, 5]);
  assert.equal(cut[0].frames, 100, 'the answers are not changed');
  assert.equal(joinStays(Array.from({ length: 300 }, (_, i) => stay(i * 100, 1)), 'time', FPS).length, 200);
});

test('a time span is a number of seconds, a day, or between two local times', () => {
  const now = new Date(2026, 10, 27, 4, 30);
  const midnight = new Date(2026, 10, 27).toISOString();
  assert.deepEqual(spanOf('600', '', '', now), ['-600', null]);
  assert.deepEqual(spanOf('today', '', '', now), [midnight, null]);
  assert.deepEqual(spanOf('yesterday', '', '', now), [new Date(2026, 10, 26).toISOString(), midnight]);
  assert.deepEqual(spanOf('between', '2026-11-27T04:00:00', '2026-11-27T04:00:01', now)[0], new Date(2026, 10, 27, 4).toISOString());
  for (const [from, to] of [['2026-11-27T04:00', '2026-11-27T04:00'], ['', '2026-11-27T04:00']]) {
    assert.throws(() => spanOf('between', from, to, now), /not after the start/);
  }
});

test('durations are rounded to what matters', () => {
  assert.deepEqual([0.2, 8.4, 125, 4805].map(duration), ['1 s', '8 s', '2 min 5 s', '1 h 20 min']);
});

test('a picture shows the person, keeps its shape, and stays inside', () => {
  assert.deepEqual(cropAround([1, 40, 40, 60, 60], 200, 100), [25, 37.5, 75, 62.5]);
  for (const box of [[1, -9, -9, 5, 30], [1, 190, 80, 220, 140], [1, 0, 0, 200, 100], [1, 10, 0, 20, 400]]) {
    const [left, top, right, bottom] = cropAround(/** @type {any} */ (box), 200, 100);
    assert.ok(left >= 0 && top >= 0 && right <= 200 && bottom <= 100, String(box));
    assert.ok(Math.abs((right - left) / (bottom - top) - 2) < 1e-9, String(box));
  }
});
