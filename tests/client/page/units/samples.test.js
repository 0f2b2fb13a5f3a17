import assert from 'node:assert/strict';
import test from 'node:test';

import { Samples } from '../../../../client/page/operator/assist/pointing_samples.js';

/** @param {number} pulse */
const at = (pulse, x = 10) => ({ pulse, x, y: 20, tolerance: 5 });

test('what is pointed at in one camera goes together, in order, and is sent once', () => {
  const samples = new Samples();
  for (const pulse of [1, 2, 3]) samples.add(7, 'c0', at(pulse));
  samples.add(7, 'c1', at(4));
  samples.add(9, 'c1', at(5));
  assert.deepEqual(samples.take(), { object: 7, camera: 'c0', corrections: [at(1), at(2), at(3)] });
  assert.deepEqual(samples.take(), { object: 7, camera: 'c1', corrections: [at(4)] });
  assert.deepEqual(samples.take(), { object: 9, camera: 'c1', corrections: [at(5)] });
  assert.equal(samples.take(), null);
});

test('a frame that is pointed at again is where it was pointed at last', () => {
  const samples = new Samples();
  samples.add(7, 'c0', at(1, 10));
  samples.add(7, 'c0', at(1, 30));
  assert.deepEqual(samples.take()?.corrections, [at(1, 30)]);
});

test('a server that is away for long is not told all that was missed', () => {
  const samples = new Samples();
  for (let pulse = 0; pulse < 1000; pulse += 1) samples.add(7, 'c0', at(pulse));
  const said = samples.take();
  assert.equal(said?.corrections.length, 250);
  assert.equal(said?.corrections.at(-1)?.pulse, 999);
});
