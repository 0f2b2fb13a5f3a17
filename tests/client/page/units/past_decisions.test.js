import assert from 'node:assert/strict';
import test from 'node:test';

import { PastDecisions } from '../../../../client/page/timeline/past_decisions.js';

const FPS = 10;

/** @param {string[]} requests */
function server(requests) {
  return async (/** @type {string} */ address) => {
    requests.push(address);
    const [from, to] = [.../** @type {any} */ (address).matchAll(/p(\d+)/g)].map(([, pulse]) => Number(pulse));
    const gops = [];
    for (let first = from - (from % 10); first < to; first += 10) {
      gops.push({ first, frames: 10, choices: { 1: 'c0' }, boxes: {}, cuts: [] });
    }
    gops.unshift({ ...gops[0], run: 'earlier', choices: { 1: 'c9' } });
    return new Response(gops.map((gop) => `${JSON.stringify(gop)}\n`).join(''));
  };
}

/** @param {number} pulse */
async function watch(past, pulse, known) {
  past.request(pulse, known);
  await new Promise((resolve) => setTimeout(resolve, 5));
}

test('decisions are requested once, ahead of playback, up to the known ones', async () => {
  const requests = /** @type {string[]} */ ([]);
  globalThis.fetch = /** @type {any} */ (server(requests));
  const past = new PastDecisions(FPS, () => undefined);
  for (let pulse = 100; pulse < 400; pulse += 1) await watch(past, pulse, 350);
  assert.equal(past.decisions.camera(1, 105), 'c0', 'not that of person 1 of an earlier run');
  assert.equal(past.decisions.camera(1, 349), 'c0');
  assert.equal(requests.length, 2);
  assert.match(requests[1], /to=p350$/);
});
