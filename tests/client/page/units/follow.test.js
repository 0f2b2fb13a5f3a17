/** Which part of the picture frames the chosen person. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Follow } from '../../../../client/page/player/viewport_follow.js';

const PICTURE = { width: 640, height: 360 };
const FRAME = 0.04; // seconds

/** @import {Part} from '../../../../client/page/player/viewport_follow.js' */

/**
 * @param {Part} part
 * @param {string} [about]
 */
function assertInside(part, about) {
  assert.ok(part.left >= -1e-9 && part.top >= -1e-9, about);
  assert.ok(part.left + part.width <= PICTURE.width + 1e-9, about);
  assert.ok(part.top + part.height <= PICTURE.height + 1e-9, about);
  assert.ok(Math.abs(part.width / part.height - PICTURE.width / PICTURE.height) < 1e-9, about);
}

test('who stands still is in the middle, and fills six tenths of the height', () => {
  const part = new Follow().step([1, 300, 100, 360, 250], PICTURE, FRAME);
  assert.deepEqual(part, { left: 330 - 250 * 16 / 18, top: 50, width: 250 * 16 / 9, height: 250 });
});

test('the part is of the shape of the picture and inside it, whatever the boxes', () => {
  let seed = 7;
  const random = () => (seed = (seed * 48271) % 2147483647) / 2147483647;
  const follow = new Follow();
  for (let n = 0; n < 5000; n += 1) {
    const [x, y, w, h] = [900 * random() - 100, 500 * random() - 100, 300 * random(), 600 * random()];
    const box = random() < 0.7 ? /** @type {any} */ ([1, x, y, x + w, y + h]) : undefined;
    const seconds = random() < 0.1 ? NaN : random() < 0.1 ? -1 : random();
    assertInside(follow.step(box, PICTURE, seconds), `${n}`);
    if (random() < 0.01) follow.reset();
  }
});

test('it moves calmly: a jump of the box is made up for in about a second, and never passed', () => {
  const follow = new Follow();
  follow.step([1, 100, 100, 140, 220], PICTURE, FRAME);
  const lefts = Array.from({ length: 50 }, () => follow.step([1, 400, 100, 440, 220], PICTURE, FRAME).left);
  const [first, last] = [lefts[0], lefts.at(-1) ?? 0];
  assert.ok(lefts.every((it, n) => n === 0 || it >= lefts[n - 1]));
  assert.ok(lefts[25] - first > 0.9 * (last - first));
  assert.ok(first < 0.2 * last);
});

test('it is the same at any frame rate', () => {
  const [fine, coarse] = [new Follow(), new Follow()];
  for (const it of [fine, coarse]) it.step([1, 100, 100, 140, 220], PICTURE, FRAME);
  let a, b;
  for (let n = 0; n < 20; n += 1) a = fine.step([1, 300, 150, 340, 250], PICTURE, 0.02);
  for (let n = 0; n < 4; n += 1) b = coarse.step([1, 300, 150, 340, 250], PICTURE, 0.1);
  for (const side of /** @type {(keyof Part)[]} */ (['left', 'top', 'width', 'height'])) {
    assert.ok(Math.abs((a?.[side] ?? 0) - (b?.[side] ?? 1)) < 1e-6, side);
  }
});

test('who is missed for a moment is waited for; then the whole picture opens', () => {
  const follow = new Follow();
  const near = follow.step([1, 300, 100, 330, 200], PICTURE, FRAME);
  for (let n = 0; n < 20; n += 1) assert.deepEqual(follow.step(undefined, PICTURE, FRAME), near);
  let part = near;
  for (let n = 0; n < 200; n += 1) part = follow.step(undefined, PICTURE, FRAME);
  assert.ok(part.height > 0.98 * PICTURE.height);
});

test('after a cut the person is framed at once', () => {
  const follow = new Follow();
  follow.step([1, 10, 10, 40, 100], PICTURE, FRAME);
  follow.reset();
  assert.deepEqual(
    follow.step([1, 400, 200, 440, 320], PICTURE, FRAME),
    new Follow().step([1, 400, 200, 440, 320], PICTURE, FRAME),
  );
});
