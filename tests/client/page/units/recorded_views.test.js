import assert from 'node:assert/strict';
import test from 'node:test';

import { RecordedViews } from '../../../../client/page/timeline/recorded_views.js';

test('views are clipped to the requested time', async () => {
  globalThis.fetch = async () => Response.json({
    views: [
      { camera: 'c0', first: 100, frames: 50 },
      { camera: 'c1', first: 150, frames: 50 },
      { camera: 'c0', first: 300, frames: 10 },
    ],
  });
  const recorded = new RecordedViews();
  assert.equal(recorded.first, Infinity);
  await recorded.refresh(1);
  assert.equal(recorded.first, 100);
  assert.deepEqual(recorded.between(120, 305), [
    { camera: 'c0', first: 120, end: 150 },
    { camera: 'c1', first: 150, end: 200 },
    { camera: 'c0', first: 300, end: 305 },
  ]);
  globalThis.fetch = async () => Response.json({ error: 'nothing is kept' }, { status: 404 });
  await recorded.refresh(2);
  assert.equal(recorded.first, Infinity, 'the views of the previous person are deleted');
});

test('only new views are requested, and all of them every ten minutes', async (context) => {
  let now = 1e6;
  context.mock.method(performance, 'now', () => now);
  const all = [{ camera: 'c0', first: 0, frames: 50 }, { camera: 'c1', first: 50, frames: 10 }];
  /** @type {string[]} */
  const requests = [];
  globalThis.fetch = async (path) => {
    requests.push(String(path));
    const from = Number(/from=p(\d+)/.exec(String(path))?.[1] ?? 0);
    return Response.json({ views: all.filter((view) => view.first + view.frames > from) });
  };
  const recorded = new RecordedViews();
  await recorded.refresh(1);
  all[1].frames = 20;
  all.push({ camera: 'c0', first: 70, frames: 5 });
  now += 31_000;
  await recorded.refresh(1);
  assert.deepEqual(recorded.views.map((view) => [view.camera, view.first, view.end]), [['c0', 0, 50], ['c1', 50, 70], ['c0', 70, 75]]);
  all.shift(); // deleted as too old
  now += 600_000;
  await recorded.refresh(1);
  assert.equal(recorded.first, 50);
  assert.deepEqual(requests, ['api/objects/1/past', 'api/objects/1/past?from=p50', 'api/objects/1/past']);
});
