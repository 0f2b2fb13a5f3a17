/** Exponential backoff. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Backoff } from '../../../../client/page/shared/backoff.js';

test('the wait doubles up to two seconds, and is reset by a success', () => {
  const backoff = new Backoff();
  assert.deepEqual(Array.from({ length: 6 }, () => backoff.next()), [250, 500, 1000, 2000, 2000, 2000]);
  backoff.reset();
  assert.equal(backoff.next(), 250);
});
