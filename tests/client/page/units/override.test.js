import assert from 'node:assert/strict';
import test from 'node:test';

import { Override } from '../../../../client/page/people/view_preference.js';

function override(camera = null, prefer = null) {
  const made = new Override({ object: 1, camera, prefer, beside: [] });
  made.configure(['c0', 'c1']);
  return made;
}

test('a camera is held until it is pressed once more', () => {
  const it = override();
  it.hold('c1');
  assert.deepEqual([it.held, it.preferred], ['c1', null]);
  it.hold('c0');
  assert.equal(it.held, 'c0');
  it.hold('c0');
  assert.equal(it.camera, null);
});

test('who is held can be preferred, and held again', () => {
  const it = override('c1');
  it.toggle();
  assert.deepEqual([it.held, it.preferred, it.written], [null, 'c1', { camera: null, prefer: 'c1' }]);
  it.toggle();
  assert.deepEqual([it.held, it.preferred, it.written], ['c1', null, { camera: 'c1', prefer: null }]);
  it.hold(null);
  it.toggle();
  assert.equal(it.preferred, null, 'there is nothing to prefer');
});

test('what the site does not have is not wished for, and stays in the address', () => {
  const it = override(null, 'c9');
  assert.deepEqual([it.camera, it.preferred, it.words('c0', 'c0', true)], [null, null, null]);
  assert.deepEqual(it.written, { camera: null, prefer: 'c9' });
});

test('it is said why a camera is shown', () => {
  assert.equal(override('c1').words('c0', 'c1', true), 'Held by hand. The best view now is c0.');
  assert.equal(override('c1').words(null, 'c1', false), 'Held by hand.');
  assert.equal(override(null, 'c1').words('c1', 'c1', true), 'Preferred. It is the best view now.');
  assert.match(override(null, 'c1').words('c0', 'c0', true), /c1 is preferred, and does not see this person/);
  assert.equal(override(null, 'c1').words('c0', 'c0', false), null, 'the past is as it was chosen');
});
