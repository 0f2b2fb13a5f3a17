import assert from 'node:assert/strict';
import test from 'node:test';

import { Kept } from '../../client/page/kept.js';

test('views are cut to the time that is asked for', async () => {
  globalThis.fetch = async () => Response.json({
    views: [
      { camera: 'c0', first: 100, frames: 50 },
      { camera: 'c1', first: 150, frames: 50 },
      { camera: 'c0', first: 300, frames: 10 },
    ],
  });
  const kept = new Kept();
  assert.equal(kept.first, Infinity);
  await kept.about(1);
  assert.equal(kept.first, 100);
  assert.deepEqual(kept.between(120, 305), [
    { camera: 'c0', first: 120, end: 150 },
    { camera: 'c1', first: 150, end: 200 },
    { camera: 'c0', first: 300, end: 305 },
  ]);
  globalThis.fetch = async () => Response.json({ error: 'nothing is kept' }, { status: 404 });
  await kept.about(2);
  assert.equal(kept.first, Infinity, 'what was kept of one person is not the next one’s');
});
