import assert from 'node:assert/strict';
import test from 'node:test';

import { Flags, when, words } from '../../../../client/page/operator/assist/flag_priority.js';

const FPS = 25;

/** @param {object} [changes] */
function flag(changes) {
  return /** @type {any} */ ({
    id: 1, objects: [7, 9], cameras: ['c0'], reason: 'crossing', pulse: 100, raised: 80, margin: 0.4, risk: 0.4, state: 'raised', ...changes,
  });
}

test('the most urgent flag comes first, and one that is over does not come', () => {
  const flags = new Flags();
  for (const it of [flag({ pulse: 130 }), flag({ id: 2, pulse: 90 }), flag({ id: 3, pulse: 90, margin: 0.1 })]) flags.take(it);
  assert.deepEqual(flags.urgent(80).map(({ id }) => id), [3, 2, 1]);
  flags.take(flag({ id: 3, state: 'followed', pulse: 140 }));
  assert.deepEqual(flags.urgent(80).map(({ id }) => id), [2, 1, 3]);
  flags.take(flag({ id: 2, state: 'expired' }));
  flags.take(flag({ id: 1, state: 'answered' }));
  assert.deepEqual(flags.urgent(80).map(({ id }) => id), [3]);
});

test('what is past is less urgent than anything ahead, and the longer ago the less', () => {
  const flags = new Flags();
  for (const [id, pulse] of [[1, 100], [2, 150], [3, 260], [4, 210], [5, 200]]) flags.take(flag({ id, pulse }));
  assert.deepEqual(flags.urgent(200).map(({ id }) => id), [5, 4, 3, 2, 1]);
  assert.equal(flags.about(7, 230)?.id, 3);
});

test('of somebody the most urgent flag that they are in is found, whatever others are in', () => {
  const flags = new Flags();
  for (const it of [flag({ objects: [5, 7] }), flag({ id: 2, pulse: 90 }), flag({ id: 3, pulse: 10, objects: [4] })]) flags.take(it);
  assert.equal(flags.about(7, 0)?.id, 2);
  assert.equal(flags.about(5, 0)?.id, 1);
  assert.equal(flags.about(8, 0), undefined);
  assert.equal(flags.about(null, 0), undefined);
});

test('it is said who, what and when', () => {
  const called = (/** @type {number} */ it) => (it === 7 ? '7 Ann' : String(it));
  assert.equal(words(flag(), called), '7 Ann and 9, alike, cross');
  assert.equal(words(flag({ reason: 'id_switch' }), called), '7 Ann and 9 may be taken for each other');
  assert.equal(words(flag({ reason: 'id_switch', objects: [9] }), called), '9 may be taken for somebody else');
  assert.equal(words(flag({ reason: 'track_loss', objects: [7] }), called), '7 Ann fades, or is lost from sight');
  assert.equal(words(flag({ reason: 'optimality_gap' }), called), 'It is not sure who is 7 Ann, and who is 9');
});

test('the time left is that of who looks at a frame that was taken a while ago', () => {
  assert.equal(when(flag(), 70, FPS), 'in 1.2 s');
  assert.equal(when(flag(), 95, FPS), 'now');
  assert.equal(when(flag(), 150, FPS), '2 s ago');
});
