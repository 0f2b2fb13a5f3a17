/** When the displayed frame is certainly from after a seek. */

import assert from 'node:assert/strict';
import { mock, test } from 'node:test';

import { afterSeek } from '../../../../client/page/player/frames.js';

class Video {
  paused = false;
  /** @type {(() => void)[]} */
  #callbacks = [];

  /** @param {() => void} callback */
  requestVideoFrameCallback(callback) {
    this.#callbacks.push(callback);
    return 0;
  }

  present() {
    for (const callback of this.#callbacks.splice(0)) callback();
  }
}

/**
 * @param {Video} video
 * @param {boolean} hidden
 */
function startSeek(video, hidden = false) {
  const callback = mock.fn();
  Object.defineProperty(globalThis, 'document', { value: { hidden }, configurable: true });
  afterSeek(/** @type {HTMLVideoElement} */ (/** @type {unknown} */ (video)), callback);
  return callback.mock;
}

test('calls back once, at the second frame: the first may be from before the seek', (test) => {
  test.mock.timers.enable({ apis: ['setTimeout'] });
  const video = new Video();
  const callback = startSeek(video);
  video.present();
  assert.equal(callback.callCount(), 0);
  video.present();
  assert.equal(callback.callCount(), 1);
  test.mock.timers.tick(10_000);
  video.present();
  assert.equal(callback.callCount(), 1);
});

test('on a hidden page, which gets no frame callbacks, calls back after a timeout', (test) => {
  test.mock.timers.enable({ apis: ['setTimeout'] });
  const callback = startSeek(new Video(), true);
  assert.equal(callback.callCount(), 0);
  test.mock.timers.tick(1000);
  assert.equal(callback.callCount(), 1);
});

test('on a visible page of a busy browser, calls back after a longer timeout', (test) => {
  test.mock.timers.enable({ apis: ['setTimeout'] });
  const callback = startSeek(new Video());
  test.mock.timers.tick(1000);
  test.mock.timers.tick(3000);
  assert.equal(callback.callCount(), 0);
  test.mock.timers.tick(1000);
  assert.equal(callback.callCount(), 1);
});

test('calls back at once while the video is paused', () => {
  const video = new Video();
  video.paused = true;
  assert.equal(startSeek(video).callCount(), 1);
});
