/** Which starts of a video are reported, and when it counts as playing. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Playback } from '../../../../client/page/player/playback.js';

class FakeVideo extends EventTarget {
  paused = true;

  play() {
    this.paused = false; // a browser dispatches `play` later
    return Promise.resolve();
  }

  pause() {
    this.paused = true;
  }

  /** @param {'play' | 'pause'} name */
  announce(name) {
    this.dispatchEvent(new Event(name));
  }
}

function createPlayback() {
  const video = new FakeVideo();
  const started = { byOthers: 0 };
  const playback = new Playback(/** @type {any} */ (video), () => (started.byOthers += 1));
  return { video, playback, started };
}

test('a video counts as paused until its start has been announced', () => {
  const { video, playback } = createPlayback();
  video.play();
  assert.equal(playback.paused, true);
  video.announce('play');
  assert.equal(playback.paused, false);
  video.pause();
  assert.equal(playback.paused, true);
  video.announce('pause');
  video.play();
  assert.equal(playback.paused, true);
});

test('a start by something else is reported, one by the page is not', () => {
  const { video, playback, started } = createPlayback();
  playback.start();
  video.announce('play');
  assert.equal(started.byOthers, 0);
  video.pause();
  video.announce('pause');
  video.play();
  video.announce('play');
  assert.equal(started.byOthers, 1);
});
