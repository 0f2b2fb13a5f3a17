/** The viewport that frames the selected person. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { ViewportFollower } from '../../../../client/page/player/viewport.js';

const PICTURE = { width: 640, height: 360 };
const FRAME = 0.04; // seconds

/** @import {Viewport} from '../../../../client/page/player/viewport.js' */

/**
 * @param {Viewport} viewport
 * @param {string} [message]
 */
function assertInside(viewport, message) {
  assert.ok(viewport.left >= -1e-9 && viewport.top >= -1e-9, message);
  assert.ok(viewport.left + viewport.width <= PICTURE.width + 1e-9, message);
  assert.ok(viewport.top + viewport.height <= PICTURE.height + 1e-9, message);
  assert.ok(Math.abs(viewport.width / viewport.height - PICTURE.width / PICTURE.height) < 1e-9, message);
}

test('a standing person is centered and fills 60 % of the height', () => {
  const viewport = new ViewportFollower().step([1, 300, 100, 360, 250], PICTURE, FRAME);
  assert.deepEqual(viewport, { left: 330 - 250 * 16 / 18, top: 50, width: 250 * 16 / 9, height: 250 });
});

test('the viewport has the aspect ratio of the picture and stays inside it, for any boxes', () => {
  let seed = 7;
  const random = () => (seed = (seed * 48271) % 2147483647) / 2147483647;
  const follower = new ViewportFollower();
  for (let n = 0; n < 5000; n += 1) {
    const [x, y, w, h] = [900 * random() - 100, 500 * random() - 100, 300 * random(), 600 * random()];
    const box = random() < 0.7 ? /** @type {any} */ ([1, x, y, x + w, y + h]) : undefined;
    const seconds = random() < 0.1 ? NaN : random() < 0.1 ? -1 : random();
    assertInside(follower.step(box, PICTURE, seconds), `${n}`);
    if (random() < 0.01) follower.reset();
  }
});

test('a jump of the box is followed in about a second, without overshoot', () => {
  const follower = new ViewportFollower();
  follower.step([1, 100, 100, 140, 220], PICTURE, FRAME);
  const lefts = Array.from({ length: 50 }, () => follower.step([1, 400, 100, 440, 220], PICTURE, FRAME).left);
  const [first, last] = [lefts[0], lefts.at(-1) ?? 0];
  assert.ok(lefts.every((left, n) => n === 0 || left >= lefts[n - 1]));
  assert.ok(lefts[25] - first > 0.9 * (last - first));
  assert.ok(first < 0.2 * last);
});

test('the motion does not depend on the frame rate', () => {
  const [fine, coarse] = [new ViewportFollower(), new ViewportFollower()];
  for (const follower of [fine, coarse]) follower.step([1, 100, 100, 140, 220], PICTURE, FRAME);
  let a, b;
  for (let n = 0; n < 20; n += 1) a = fine.step([1, 300, 150, 340, 250], PICTURE, 0.02);
  for (let n = 0; n < 4; n += 1) b = coarse.step([1, 300, 150, 340, 250], PICTURE, 0.1);
  for (const side of /** @type {(keyof Viewport)[]} */ (['left', 'top', 'width', 'height'])) {
    assert.ok(Math.abs((a?.[side] ?? 0) - (b?.[side] ?? 1)) < 1e-6, side);
  }
});

test('without a detection the viewport holds for a second, then opens to the whole picture', () => {
  const follower = new ViewportFollower();
  const near = follower.step([1, 300, 100, 330, 200], PICTURE, FRAME);
  for (let n = 0; n < 20; n += 1) assert.deepEqual(follower.step(undefined, PICTURE, FRAME), near);
  let viewport = near;
  for (let n = 0; n < 200; n += 1) viewport = follower.step(undefined, PICTURE, FRAME);
  assert.ok(viewport.height > 0.98 * PICTURE.height);
});

test('after a reset the person is framed at once', () => {
  const follower = new ViewportFollower();
  follower.step([1, 10, 10, 40, 100], PICTURE, FRAME);
  follower.reset();
  assert.deepEqual(
    follower.step([1, 400, 200, 440, 320], PICTURE, FRAME),
    new ViewportFollower().step([1, 400, 200, 440, 320], PICTURE, FRAME),
  );
});
