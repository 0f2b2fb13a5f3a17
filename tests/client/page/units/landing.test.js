/** When the picture goes over to a stream that has just begun, and at which moment. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { begunAnew, landingOf } from '../../../../client/page/player/cut_over.js';
import { Run } from '../../../../client/page/player/media/stream_download.js';

const ANYBODY = { object: 1, camera: null, prefer: null, past: null };
const GOP_S = 0.4;
const SOON = 0.01; // seconds: so near to the start of a stream is its start

/**
 * @param {{start: number, since?: number, past?: number}} stream
 * @returns {Run} a stream whose first frame, at `start`, is in the buffer
 */
function stream({ start, since = 0, past }) {
  const run = new Run({ ...ANYBODY, past: past === undefined ? null : { pulse: 0, time: past } }, GOP_S);
  return Object.assign(run, { start, since });
}

test('a stream that has the moment now shown is met at that moment', () => {
  assert.equal(landingOf(stream({ start: 10 }), 14, 12, 0), 12);
  assert.equal(landingOf(stream({ start: 0 }), 1, 0, 0), 0);
});

test('a stream that is still behind it is waited for, and then met where it begins', () => {
  const behind = stream({ start: 10, since: 1000 });
  assert.equal(landingOf(behind, 11, 12, 1200), null);
  const late = landingOf(behind, 11, 12, 1300) ?? NaN;
  assert.ok(late >= 10 && late < 10 + SOON);
});

test('a stream that is ahead of it, or whose pulses have begun anew, is waited for in vain', () => {
  for (const [start, time] of [[15, 12], [0, 60]]) {
    const landed = landingOf(stream({ start }), start + 1, time, 0) ?? NaN;
    assert.ok(landed >= start && landed < start + SOON);
  }
  assert.ok(begunAnew(0, 60, GOP_S));
  assert.ok(!begunAnew(55, 60, GOP_S));
  assert.ok(!begunAnew(45, 60, 12), 'a GOP is as long');
});

test('a past is met at its moment, once that has come', () => {
  assert.equal(landingOf(stream({ start: 9, past: 10 }), 10, 60, 5000), null);
  const landed = landingOf(stream({ start: 9, past: 10 }), 11, 60, 0) ?? NaN;
  assert.ok(landed >= 10 && landed < 10 + SOON);
});
