/** How the player stays live, played against streams that arrive as networks let them. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { Pace } from '../../../../client/page/player/pace.js';

/**
 * Play for some seconds against a stream that arrives `burst` seconds at a time.
 *
 * @param {{behind?: number, burst: number, seconds: number, gopS?: number, late?: (gop: number) => number}} stream
 *   `late`: seconds that a burst comes late; none overtakes another
 */
function played({ behind = 0, burst, seconds, gopS = 0, late = () => 0 }) {
  const pace = new Pace();
  pace.gopS = gopS;
  const log = [];
  const step = 0.01; // seconds
  let [time, end, rate, arrived, standing] = [0, behind, 1, 0, false];
  for (let tick = 0; tick * step < seconds; tick += 1) {
    const now = tick * step;
    while ((arrived + 1) * burst + late(arrived + 1) <= now + 1e-9) {
      arrived += 1;
      end = behind + arrived * burst;
    }
    if (tick % 10 === 0) {
      const next = pace.step(now, time, [[-100, end]]);
      rate = next.rate;
      time = next.seek ?? time;
      log.push({ now, time, lead: end - time, ...next });
    }
    const stands = time + step * rate > end;
    if (stands && !standing) pace.stalled();
    standing = stands;
    if (!stands) time += step * rate;
    log.at(-1).stood = stands || log.at(-1).stood;
  }
  return log;
}

for (const burst of [0.04, 0.4, 1]) {
  for (const behind of [0, 0.3, 2.5]) {
    test(`it settles close to live without standing: ${burst} s at a time, ${behind} s behind`, () => {
      const log = played({ behind: behind + burst, burst, seconds: 40 });
      const settled = log.filter((it) => it.now > 25);
      const lowest = Math.min(...settled.map((it) => it.lead));
      assert.ok(lowest > 0.02 && lowest < 0.2, `${lowest}`);
      assert.ok(settled.every((it) => !it.stood));
      assert.equal(log.some((it) => it.seek !== null), behind + burst > 3);
    });
  }
}

for (const gopS of [3.5, 4, 10]) {
  test(`GOPs of ${gopS} s are played whole, however far ahead one comes`, () => {
    const log = played({ behind: gopS, burst: gopS, seconds: 12 * gopS, gopS });
    assert.ok(log.every((it) => it.seek === null));
    assert.ok(log.filter((it) => it.stood).length < 5, 'for a moment, a few times');
    assert.ok(Math.max(...log.map((it) => it.lead)) < gopS + 0.2);
  });
}

test('far behind it jumps, once', () => {
  const log = played({ behind: 20, burst: 0.4, seconds: 1 });
  assert.ok(Math.abs(log[0].seek - (20 - 0.08)) < 1e-9);
  assert.ok(log.slice(1).every((it) => it.seek === null));
});

test('a network that is late now and then is kept further away from', () => {
  const late = (/** @type {number} */ gop) => (gop % 20 === 0 ? 0.2 : 0);
  const log = played({ behind: 0.4, burst: 0.4, seconds: 120, late });
  const settled = log.filter((it) => it.now > 60);
  assert.ok(settled.every((it) => !it.stood), 'it has learned');
  assert.ok(Math.max(...settled.map((it) => it.now - it.time)) < 0.5, 'and is no further behind than that');
});

test('a rough beginning is soon forgotten', () => {
  const late = (/** @type {number} */ gop) => (gop < 8 ? 1.2 : 0);
  const log = played({ behind: 0.4, burst: 0.4, seconds: 20, late });
  const settled = log.filter((it) => it.now > 14);
  assert.ok(Math.max(...settled.map((it) => it.now - it.time)) < 0.35, `${settled[0].now - settled[0].time}`);
});

test('it is never slower or faster than anybody would bear', () => {
  let seed = 1;
  const random = () => (seed = (seed * 48271) % 2147483647) / 2147483647;
  const lates = Array.from({ length: 500 }, () => (random() < 0.1 ? random() : 0.05 * random()));
  const log = played({ behind: 0.4, burst: 0.4, seconds: 150, late: (gop) => lates[gop] });
  assert.ok(log.every((it) => it.rate >= 0.94 && it.rate <= 1.25));
});

test('a hole right ahead is jumped, no other', () => {
  /** @type {[number, [number, number][], number | null][]} */
  const cases = [
    [4.99, [[0, 5], [5.2, 8]], 5.201],
    [5.1, [[0, 5], [5.2, 8]], 5.201],
    [3, [[0, 5], [5.2, 6]], null],
    [1, [[2, 3]], 2.001],
    [4, [[2, 3]], null],
    [4, [], null],
  ];
  for (const [time, ranges, seek] of cases) {
    const jump = new Pace().step(0, time, ranges).seek;
    assert.equal(jump?.toFixed(6), seek?.toFixed(6), JSON.stringify([time, ranges]));
  }
});
