/** When the picture after a seek is surely the one that the seek has led to. */

import assert from 'node:assert/strict';
import { mock, test } from 'node:test';

import { arrived } from '../../../../client/page/player/frames.js';

class Video {
  paused = false;
  /** @type {(() => void)[]} */
  #asked = [];

  /** @param {() => void} then */
  requestVideoFrameCallback(then) {
    this.#asked.push(then);
    return 0;
  }

  present() {
    for (const then of this.#asked.splice(0)) then();
  }
}

/**
 * @param {Video} video
 * @param {boolean} hidden
 */
function told(video, hidden = false) {
  const then = mock.fn();
  Object.defineProperty(globalThis, 'document', { value: { hidden }, configurable: true });
  arrived(/** @type {HTMLVideoElement} */ (/** @type {unknown} */ (video)), then);
  return then.mock;
}

test('the first frame may be from before the seek; the second is not, and it is said once', (test) => {
  test.mock.timers.enable({ apis: ['setTimeout'] });
  const video = new Video();
  const then = told(video);
  video.present();
  assert.equal(then.callCount(), 0);
  video.present();
  assert.equal(then.callCount(), 1);
  test.mock.timers.tick(10_000);
  video.present();
  assert.equal(then.callCount(), 1);
});

test('a page that is hidden is told of no frame, and does not wait for one for ever', (test) => {
  test.mock.timers.enable({ apis: ['setTimeout'] });
  const then = told(new Video(), true);
  assert.equal(then.callCount(), 0);
  test.mock.timers.tick(1000);
  assert.equal(then.callCount(), 1);
});

test('a page that is seen waits for a browser that is busy, but not for ever', (test) => {
  test.mock.timers.enable({ apis: ['setTimeout'] });
  const then = told(new Video());
  test.mock.timers.tick(1000);
  test.mock.timers.tick(3000);
  assert.equal(then.callCount(), 0);
  test.mock.timers.tick(1000);
  assert.equal(then.callCount(), 1);
});

test('of a picture that stands still nothing more comes to wait for', () => {
  const video = new Video();
  video.paused = true;
  assert.equal(told(video).callCount(), 1);
});
