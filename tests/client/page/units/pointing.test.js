import assert from 'node:assert/strict';
import test from 'node:test';

import { CorrectionQueue } from '../../../../client/page/operator/assist/pointing.js';

/** @param {number} pulse */
const at = (pulse, x = 10) => ({ pulse, x, y: 20, tolerance: 5 });

test('corrections are batched by person and camera, in order', () => {
  const queue = new CorrectionQueue();
  for (const pulse of [1, 2, 3]) queue.add(7, 'c0', at(pulse));
  queue.add(7, 'c1', at(4));
  queue.add(9, 'c1', at(5));
  assert.deepEqual(queue.take(), { object: 7, camera: 'c0', corrections: [at(1), at(2), at(3)] });
  assert.deepEqual(queue.take(), { object: 7, camera: 'c1', corrections: [at(4)] });
  assert.deepEqual(queue.take(), { object: 9, camera: 'c1', corrections: [at(5)] });
  assert.equal(queue.take(), null);
});

test('a later correction of the same frame replaces the earlier one', () => {
  const queue = new CorrectionQueue();
  queue.add(7, 'c0', at(1, 10));
  queue.add(7, 'c0', at(1, 30));
  assert.deepEqual(queue.take()?.corrections, [at(1, 30)]);
});

test('only the newest corrections are kept', () => {
  const queue = new CorrectionQueue();
  for (let pulse = 0; pulse < 1000; pulse += 1) queue.add(7, 'c0', at(pulse));
  const batch = queue.take();
  assert.equal(batch?.corrections.length, 250);
  assert.equal(batch?.corrections.at(-1)?.pulse, 999);
});
