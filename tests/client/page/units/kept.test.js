import assert from 'node:assert/strict';
import test from 'node:test';

import { Kept } from '../../../../client/page/timeline/available_past.js';

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

test('later only what is new is asked for, and once in a while all of it', async (context) => {
  let now = 1e6;
  context.mock.method(performance, 'now', () => now);
  const all = [{ camera: 'c0', first: 0, frames: 50 }, { camera: 'c1', first: 50, frames: 10 }];
  /** @type {string[]} */
  const asked = [];
  globalThis.fetch = async (path) => {
    asked.push(String(path));
    const from = Number(/from=p(\d+)/.exec(String(path))?.[1] ?? 0);
    return Response.json({ views: all.filter((it) => it.first + it.frames > from) });
  };
  const kept = new Kept();
  await kept.about(1);
  all[1].frames = 20;
  all.push({ camera: 'c0', first: 70, frames: 5 });
  now += 31_000;
  await kept.about(1);
  assert.deepEqual(kept.views.map((it) => [it.camera, it.first, it.end]), [['c0', 0, 50], ['c1', 50, 70], ['c0', 70, 75]]);
  all.shift(); // what is too old
  now += 600_000;
  await kept.about(1);
  assert.equal(kept.first, 50);
  assert.deepEqual(asked, ['api/objects/1/past', 'api/objects/1/past?from=p50', 'api/objects/1/past']);
});
