/** The offset of the server's clock, estimated from requests and answers. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { ServerClock } from '../../../../client/page/player/server_clock.js';

test('the sample with the shortest round trip counts', () => {
  const clock = new ServerClock();
  clock.add(0, 800, 7);
  clock.add(1000, 1010, 3.505);
  clock.add(0, 90, 9);
  assert.equal(clock.offset, 2500);
});

test('old samples are dropped, and those of another server', () => {
  const clock = new ServerClock();
  assert.equal(clock.offset, null);
  clock.add(0, 2, 1.001);
  for (let n = 0; n < 8; n += 1) clock.add(0, 100, 2.05);
  assert.equal(clock.offset, 2000);
  clock.clear();
  assert.equal(clock.offset, null);
});

test('the error is at most half the round trip', () => {
  for (let sent = 0; sent < 50; sent += 7) {
    for (const [there, back] of [[0, 40], [40, 0], [3, 4], [200, 10]]) {
      const clock = new ServerClock();
      clock.add(sent, sent + there + back, (sent + there + 5000) / 1000);
      assert.ok(Math.abs(/** @type {number} */ (clock.offset) - 5000) <= (there + back) / 2 + 1e-9);
    }
  }
});
