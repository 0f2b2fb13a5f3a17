/** The server's clock, guessed from questions and answers. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { ServerClock } from '../../../../client/page/player/clock.js';

test('the quickest answer is believed', () => {
  const clock = new ServerClock();
  clock.add(0, 800, 7);
  clock.add(1000, 1010, 3.505);
  clock.add(0, 90, 9);
  assert.equal(clock.offset, 2500);
});

test('of long ago nothing is kept, and of another server neither', () => {
  const clock = new ServerClock();
  assert.equal(clock.offset, null);
  clock.add(0, 2, 1.001);
  for (let n = 0; n < 8; n += 1) clock.add(0, 100, 2.05);
  assert.equal(clock.offset, 2000);
  clock.clear();
  assert.equal(clock.offset, null);
});

test('it is wrong by half the round trip at most', () => {
  for (let sent = 0; sent < 50; sent += 7) {
    for (const [there, back] of [[0, 40], [40, 0], [3, 4], [200, 10]]) {
      const clock = new ServerClock();
      clock.add(sent, sent + there + back, (sent + there + 5000) / 1000);
      assert.ok(Math.abs(/** @type {number} */ (clock.offset) - 5000) <= (there + back) / 2 + 1e-9);
    }
  }
});
