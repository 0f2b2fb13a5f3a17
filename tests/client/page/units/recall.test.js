import assert from 'node:assert/strict';
import test from 'node:test';

import { Recall } from '../../../../client/page/timeline/past_decisions.js';

const FPS = 10;

/** @param {string[]} asked */
function server(asked) {
  return async (/** @type {string} */ address) => {
    asked.push(address);
    const [from, to] = [.../** @type {any} */ (address).matchAll(/p(\d+)/g)].map(([, pulse]) => Number(pulse));
    const gops = [];
    for (let first = from - (from % 10); first < to; first += 10) {
      gops.push({ first, frames: 10, choices: { 1: 'c0' }, boxes: {}, cuts: [] });
    }
    gops.unshift({ ...gops[0], run: 'earlier', choices: { 1: 'c9' } });
    return new Response(gops.map((it) => `${JSON.stringify(it)}\n`).join(''));
  };
}

/** @param {number} pulse */
async function watch(recall, pulse, known) {
  recall.want(pulse, known);
  await new Promise((resolve) => setTimeout(resolve, 5));
}

test('what is watched is asked for once, in good time, and up to what is known', async () => {
  const asked = /** @type {string[]} */ ([]);
  globalThis.fetch = /** @type {any} */ (server(asked));
  const recall = new Recall(FPS, () => undefined);
  for (let pulse = 100; pulse < 400; pulse += 1) await watch(recall, pulse, 350);
  assert.equal(recall.decisions.camera(1, 105), 'c0', 'not what an earlier run said of its person 1');
  assert.equal(recall.decisions.camera(1, 349), 'c0');
  assert.equal(asked.length, 2);
  assert.match(asked[1], /to=p350$/);
});
