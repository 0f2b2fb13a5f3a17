/** Live latency control, simulated against streams with bursts and jitter. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { LatencyController } from '../../../../client/page/player/latency_control.js';

/**
 * Simulate playback of a stream that arrives `burst` seconds at a time.
 *
 * @param {{behind?: number, burst: number, seconds: number, gopS?: number, late?: (gop: number) => number}} stream
 *   `late`: seconds of delay of a burst; bursts stay in order
 */
function simulate({ behind = 0, burst, seconds, gopS = 0, late = () => 0 }) {
  const controller = new LatencyController();
  controller.gopS = gopS;
  const log = [];
  const step = 0.01; // seconds
  let [time, end, rate, arrived, stalled] = [0, behind, 1, 0, false];
  for (let tick = 0; tick * step < seconds; tick += 1) {
    const now = tick * step;
    while ((arrived + 1) * burst + late(arrived + 1) <= now + 1e-9) {
      arrived += 1;
      end = behind + arrived * burst;
    }
    if (tick % 10 === 0) {
      const next = controller.step(now, time, [[-100, end]]);
      rate = next.rate;
      time = next.seek ?? time;
      log.push({ now, time, lead: end - time, ...next });
    }
    const stalls = time + step * rate > end;
    if (stalls && !stalled) controller.stalled();
    stalled = stalls;
    if (!stalls) time += step * rate;
    log.at(-1).stalled = stalls || log.at(-1).stalled;
  }
  return log;
}

for (const burst of [0.04, 0.4, 1]) {
  for (const behind of [0, 0.3, 2.5]) {
    test(`settles close to live without stalls: ${burst} s per burst, ${behind} s behind`, () => {
      const log = simulate({ behind: behind + burst, burst, seconds: 40 });
      const settled = log.filter((entry) => entry.now > 25);
      const lowest = Math.min(...settled.map((entry) => entry.lead));
      assert.ok(lowest > 0.02 && lowest < 0.2, `${lowest}`);
      assert.ok(settled.every((entry) => !entry.stalled));
      assert.equal(log.some((entry) => entry.seek !== null), behind + burst > 3);
    });
  }
}

for (const gopS of [3.5, 4, 10]) {
  test(`GOPs of ${gopS} s are played whole, however early one arrives`, () => {
    const log = simulate({ behind: gopS, burst: gopS, seconds: 12 * gopS, gopS });
    assert.ok(log.every((entry) => entry.seek === null));
    assert.ok(log.filter((entry) => entry.stalled).length < 5, 'a few short stalls');
    assert.ok(Math.max(...log.map((entry) => entry.lead)) < gopS + 0.2);
  });
}

test('far behind, it jumps once', () => {
  const log = simulate({ behind: 20, burst: 0.4, seconds: 1 });
  assert.ok(Math.abs(log[0].seek - (20 - 0.08)) < 1e-9);
  assert.ok(log.slice(1).every((entry) => entry.seek === null));
});

test('occasional delays of the network raise the latency', () => {
  const late = (/** @type {number} */ gop) => (gop % 20 === 0 ? 0.2 : 0);
  const log = simulate({ behind: 0.4, burst: 0.4, seconds: 120, late });
  const settled = log.filter((entry) => entry.now > 60);
  assert.ok(settled.every((entry) => !entry.stalled), 'adapted');
  assert.ok(Math.max(...settled.map((entry) => entry.now - entry.time)) < 0.5, 'no more latency than needed');
});

test('an irregular start is soon forgotten', () => {
  const late = (/** @type {number} */ gop) => (gop < 8 ? 1.2 : 0);
  const log = simulate({ behind: 0.4, burst: 0.4, seconds: 20, late });
  const settled = log.filter((entry) => entry.now > 14);
  assert.ok(Math.max(...settled.map((entry) => entry.now - entry.time)) < 0.35, `${settled[0].now - settled[0].time}`);
});

test('the playback rate stays between 0.94 and 1.25', () => {
  let seed = 1;
  const random = () => (seed = (seed * 48271) % 2147483647) / 2147483647;
  const lates = Array.from({ length: 500 }, () => (random() < 0.1 ? random() : 0.05 * random()));
  const log = simulate({ behind: 0.4, burst: 0.4, seconds: 150, late: (gop) => lates[gop] });
  assert.ok(log.every((entry) => entry.rate >= 0.94 && entry.rate <= 1.25));
});

test('a gap right ahead is jumped, no other', () => {
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
    const jump = new LatencyController().step(0, time, ranges).seek;
    assert.equal(jump?.toFixed(6), seek?.toFixed(6), JSON.stringify([time, ranges]));
  }
});
