/** Splitting a live WebM stream into whole segments. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { ClusterSplitter } from '../../../../client/page/player/media/webm.js';

const size = (/** @type {number} */ bytes) => [0x10, bytes >> 16, (bytes >> 8) & 255, bytes & 255];
const element = (/** @type {number[]} */ id, /** @type {number[]} */ body) => [...id, ...size(body.length), ...body];
const time = (/** @type {number} */ ms) => [0xe7, 0x88, 0, 0, 0, 0, ...new Uint8Array(new Uint32Array([ms]).buffer).reverse()];
const picture = (/** @type {number} */ ms, /** @type {number} */ bytes) =>
  element([0x1f, 0x43, 0xb6, 0x75], [...time(ms), ...element([0xa3], Array(bytes).fill(ms % 251))]);

const HEAD = [
  ...element([0x1a, 0x45, 0xdf, 0xa3], [0x42, 0x86, 0x81, 1]),
  ...[0x18, 0x53, 0x80, 0x67, 0x01, 255, 255, 255, 255, 255, 255, 255],
  ...element([0x15, 0x49, 0xa9, 0x66], [0x2a, 0xd7, 0xb1, 0x83, 15, 66, 64]),
  ...element([0x16, 0x54, 0xae, 0x6b], Array(40).fill(0)),
];
const PICTURES = [picture(40, 300), picture(80, 5), picture(3_600_120, 20_000)];
const STREAM = Uint8Array.from([...HEAD, ...PICTURES.flat()]);

test('segments are whole, in order and timed, for any chunk size', () => {
  for (const step of [1, 7, 100, 5000, STREAM.length]) {
    const splitter = new ClusterSplitter();
    const segments = [];
    for (let at = 0; at < STREAM.length; at += step) segments.push(...splitter.push(STREAM.slice(at, at + step)));
    assert.deepEqual(segments.map(({ kind, start }) => [kind, start]), [
      ['init', 0], ['media', 0.04], ['media', 0.08], ['media', 3600.12],
    ]);
    assert.deepEqual(segments.map(({ bytes }) => bytes.length), [HEAD, ...PICTURES].map(({ length }) => length));
    assert.deepEqual(Uint8Array.from(segments.flatMap(({ bytes }) => [...bytes])), STREAM);
  }
});

test('data that is not WebM is rejected', () => {
  assert.throws(() => new ClusterSplitter().push(Uint8Array.from([0, 0, 0, 24, 102])), /not a WebM/);
  const huge = Uint8Array.from([0x1f, 0x43, 0xb6, 0x75, 0x08, 255, 255, 255, 255]);
  assert.throws(() => new ClusterSplitter().push(huge), /of \d+ bytes/);
});
