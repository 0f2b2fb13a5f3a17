/** When the video element switches to a newly started stream, and at which media time. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { hasRestarted, mayBelongTo, switchTime } from '../../../../client/page/player/stream_switch.js';
import { StreamDownload } from '../../../../client/page/player/media/stream_download.js';

const SELECTION = { object: 1, camera: null, prefer: null, past: null };
const GOP_S = 0.4;
const TOLERANCE_S = 0.01;

/**
 * @param {{start: number, bufferedAt?: number, past?: number}} stream
 * @returns {StreamDownload} whose first frame, at `start`, is in the buffer
 */
function stream({ start, bufferedAt = 0, past }) {
  const download = new StreamDownload({ ...SELECTION, past: past === undefined ? null : { pulse: 0, time: past } }, GOP_S);
  return Object.assign(download, { start, bufferedAt });
}

test('a stream that contains the displayed time is joined there', () => {
  assert.equal(switchTime(stream({ start: 10 }), 14, 12, 0), 12);
  assert.equal(switchTime(stream({ start: 0 }), 1, 0, 0), 0);
});

test('a stream behind the displayed time may catch up, and is then joined at its start', () => {
  const behind = stream({ start: 10, bufferedAt: 1000 });
  assert.equal(switchTime(behind, 11, 12, 1200), null);
  const late = switchTime(behind, 11, 12, 1300) ?? NaN;
  assert.ok(late >= 10 && late < 10 + TOLERANCE_S);
});

test('a stream ahead of the displayed time, or with restarted pulses, is joined at its start at once', () => {
  for (const [start, shown] of [[15, 12], [0, 60]]) {
    const time = switchTime(stream({ start }), start + 1, shown, 0) ?? NaN;
    assert.ok(time >= start && time < start + TOLERANCE_S);
  }
  assert.ok(hasRestarted(0, 60, GOP_S));
  assert.ok(!hasRestarted(55, 60, GOP_S));
  assert.ok(!hasRestarted(45, 60, 12), 'within two GOPs');
});

test('a stream that is later for good is joined at its start at once', () => {
  const time = switchTime(stream({ start: 10 }), 10.4, 12, 0) ?? NaN;
  assert.ok(time >= 10 && time < 10 + TOLERANCE_S);
});

test('a frame from where the new stream starts may be its own until the element has switched', () => {
  const next = stream({ start: 10 });
  assert.ok(mayBelongTo(next, 10) && mayBelongTo(next, 10.2));
  assert.ok(!mayBelongTo(next, 9.96), 'the stream on the screen');
  assert.ok(!mayBelongTo(stream({ start: NaN }), 10), 'nothing was received yet');
  assert.ok(!mayBelongTo(Object.assign(next, { onScreen: true }), 10.2));
});

test('a past stream is joined at the requested time once that is buffered', () => {
  assert.equal(switchTime(stream({ start: 9, past: 10 }), 10, 60, 5000), null);
  const time = switchTime(stream({ start: 9, past: 10 }), 11, 60, 0) ?? NaN;
  assert.ok(time >= 10 && time < 10 + TOLERANCE_S);
});
