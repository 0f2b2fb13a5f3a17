import assert from 'node:assert/strict';
import test from 'node:test';

import { Decisions } from '../../../../client/page/timeline/decisions.js';

// As in tests/server/service/streaming/test_preferred_camera.py: per GOP, in how many of five frames the preferred camera sees the person.
const CASES = [
  [[5, 5, 5, 5], '0000'],
  [[5, 5, 0, 5, 5], '00110'],
  [[0, 5, 5, 5], '1100'],
  [[3, 3, 2, 3, 3], '00110'],
  [[5, 0, 5, 0, 5], '01111'],
];

for (const [seen, shown] of CASES) {
  test(`frames seen per GOP: ${seen}`, () => {
    const decisions = new Decisions(25);
    for (const [at, frames] of seen.entries()) {
      const boxes = { c0: Array.from({ length: 5 }, (_, frame) => (frame < frames ? [[1, 1, 1, 9, 9]] : [])), c1: [] };
      decisions.add({ first: 5 * at, frames: 5, choices: { 1: 'c1' }, boxes, cuts: [] });
    }
    assert.equal(seen.map((_, at) => decisions.preferring(1, 'c0', 5 * at + 2)?.[1]).join(''), shown);
  });
}

test('a person is found under an alias', () => {
  const decisions = new Decisions(25);
  decisions.rename([{ object: 1, aliases: [7] }]);
  decisions.add({ first: 0, frames: 1, choices: { 7: 'c1' }, boxes: { c0: [[[7, 1, 1, 9, 9]]] }, cuts: [] });
  assert.equal(decisions.preferring(1, 'c0', 0), 'c0');
});
