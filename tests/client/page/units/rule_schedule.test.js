/** What restricts a rule, as text that people read and write. */

import assert from 'node:assert/strict';
import { test } from 'node:test';

import { describeRestrictions, readPeople, writePeople } from '../../../../client/page/operator/zones/rule_schedule.js';

const ALWAYS = { people: [], days: null, hours: null, cameras: [] };

test('a rule says when and for whom it applies', () => {
  assert.equal(describeRestrictions(ALWAYS), 'always, for everybody');
  assert.equal(describeRestrictions({ ...ALWAYS, hours: ['00:00', '00:00'] }), 'always, for everybody');
  assert.equal(describeRestrictions({ ...ALWAYS, days: ['sat', 'mon', 'tue', 'wed'], hours: ['08:30', '12:00'] }), 'Mon–Wed, Sat, 08:30 to 12:00');
  assert.equal(
    describeRestrictions({ people: [3, 'Ann'], days: ['fri'], hours: ['22:00', '06:00'], cameras: ['c0', 'c1'] }),
    'Fri, 22:00 to 06:00 of the next day, for 3, Ann, while c0, c1 are clear',
  );
});

test('people are numbers, names, or names in quotes', () => {
  for (const people of [[], [3], [3, 'Ann'], ['Ann B', '3', 'Ann, or "Bob"', ' x', 'é'], ['a\\b']]) assert.deepEqual(readPeople(writePeople(people)), people);
  assert.deepEqual(readPeople(' 07 ,Ann  '), [7, 'Ann']);
  assert.deepEqual(readPeople('  '), []);
});

test('what are no people is refused with one line', () => {
  for (const text of [',', '3,', '3,,4', 'Ann "B"', '"Ann', '""', '9999999999', 'a,'.repeat(101) + 'a']) {
    assert.throws(() => readPeople(text), /^(Syntax)?Error: [^\n]+$/, text);
  }
});
