import assert from 'node:assert/strict';
import test from 'node:test';

import { describeFlag, describeTime, OpenFlags } from '../../../../client/page/operator/assist/flag_priority.js';

const FPS = 25;

/** @param {object} [changes] */
function flag(changes) {
  return /** @type {any} */ ({
    id: 1, objects: [7, 9], cameras: ['c0'], reason: 'crossing', pulse: 100, raised: 80, margin: 0.4, risk: 0.4, state: 'raised', ...changes,
  });
}

test('open flags are sorted by urgency', () => {
  const flags = new OpenFlags();
  for (const open of [flag({ pulse: 130 }), flag({ id: 2, pulse: 90 }), flag({ id: 3, pulse: 90, margin: 0.1 })]) flags.update(open);
  assert.deepEqual(flags.byUrgency(80).map(({ id }) => id), [3, 2, 1]);
  flags.update(flag({ id: 3, state: 'followed', pulse: 140 }));
  assert.deepEqual(flags.byUrgency(80).map(({ id }) => id), [2, 1, 3]);
  flags.update(flag({ id: 2, state: 'expired' }));
  flags.update(flag({ id: 1, state: 'answered' }));
  assert.deepEqual(flags.byUrgency(80).map(({ id }) => id), [3]);
});

test('past events are less urgent than future ones, and older ones least', () => {
  const flags = new OpenFlags();
  for (const [id, pulse] of [[1, 100], [2, 150], [3, 260], [4, 210], [5, 200]]) flags.update(flag({ id, pulse }));
  assert.deepEqual(flags.byUrgency(200).map(({ id }) => id), [5, 4, 3, 2, 1]);
  assert.equal(flags.mostUrgentOf(7, 230)?.id, 3);
});

test('the most urgent flag of a person is found', () => {
  const flags = new OpenFlags();
  for (const open of [flag({ objects: [5, 7] }), flag({ id: 2, pulse: 90 }), flag({ id: 3, pulse: 10, objects: [4] })]) flags.update(open);
  assert.equal(flags.mostUrgentOf(7, 0)?.id, 2);
  assert.equal(flags.mostUrgentOf(5, 0)?.id, 1);
  assert.equal(flags.mostUrgentOf(8, 0), undefined);
  assert.equal(flags.mostUrgentOf(null, 0), undefined);
});

test('flags are described with people and reason', () => {
  const labelOf = (/** @type {number} */ object) => (object === 7 ? '7 Ann' : String(object));
  assert.equal(describeFlag(flag(), labelOf), '7 Ann and 9 look alike and cross');
  assert.equal(describeFlag(flag({ reason: 'id_switch' }), labelOf), '7 Ann and 9 may be swapped');
  assert.equal(describeFlag(flag({ reason: 'id_switch', objects: [9] }), labelOf), '9 may be mistaken for someone else');
  assert.equal(describeFlag(flag({ reason: 'track_loss', objects: [7] }), labelOf), '7 Ann may be lost');
  assert.equal(describeFlag(flag({ reason: 'optimality_gap' }), labelOf), '7 Ann and 9: identities uncertain');
});

test('the time is relative to the displayed frame', () => {
  assert.equal(describeTime(flag(), 70, FPS), 'in 1.2 s');
  assert.equal(describeTime(flag(), 95, FPS), 'now');
  assert.equal(describeTime(flag(), 150, FPS), '2 s ago');
});
