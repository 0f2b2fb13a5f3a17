import assert from 'node:assert/strict';
import test from 'node:test';

import { ViewPreference } from '../../../../client/page/people/view_preference.js';

function preferenceOf(camera = null, prefer = null) {
  const preference = new ViewPreference({ object: 1, camera, prefer, beside: [] });
  preference.configure(['c0', 'c1']);
  return preference;
}

test('a camera is held until it is pressed once more', () => {
  const preference = preferenceOf();
  preference.hold('c1');
  assert.deepEqual([preference.held, preference.preferred], ['c1', null]);
  preference.hold('c0');
  assert.equal(preference.held, 'c0');
  preference.hold('c0');
  assert.equal(preference.camera, null);
});

test('a held camera can be preferred, and held again', () => {
  const preference = preferenceOf('c1');
  preference.togglePrefer();
  assert.deepEqual([preference.held, preference.preferred, preference.addressPart], [null, 'c1', { camera: null, prefer: 'c1' }]);
  preference.togglePrefer();
  assert.deepEqual([preference.held, preference.preferred, preference.addressPart], ['c1', null, { camera: 'c1', prefer: null }]);
  preference.hold(null);
  preference.togglePrefer();
  assert.equal(preference.preferred, null, 'there is nothing to prefer');
});

test('a camera that the site lacks is ignored, but stays in the address', () => {
  const preference = preferenceOf(null, 'c9');
  assert.deepEqual([preference.camera, preference.preferred, preference.reason('c0', 'c0', true)], [null, null, null]);
  assert.deepEqual(preference.addressPart, { camera: null, prefer: 'c9' });
});

test('the reason names the preference and the best view', () => {
  assert.equal(preferenceOf('c1').reason('c0', 'c1', true), 'Held. The best view now is c0.');
  assert.equal(preferenceOf('c1').reason(null, 'c1', false), 'Held.');
  assert.equal(preferenceOf(null, 'c1').reason('c1', 'c1', true), 'Preferred. It is the best view now.');
  assert.match(preferenceOf(null, 'c1').reason('c0', 'c0', true), /c1 is preferred, but does not see this person/);
  assert.equal(preferenceOf(null, 'c1').reason('c0', 'c0', false), null, 'cameras are preferred only live');
});
