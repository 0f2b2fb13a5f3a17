/** The quiet line at the top of every view: what may go wrong soon, and whom to point at. */

import { element } from '../../shared/element.js';
import { Flags, NOW_S, when, words } from './flag_priority.js';
import { label } from '../../people/names.js';

/** @import {Flag} from '../../shared/contract.js' */
/** @import {Pointing} from './pointing.js' */
/** @import {Viewer} from '../../viewer.js' */

const BEFORE_S = 1; // what is over in the picture is seen again from so long before it

export class Banner {
  flags = new Flags();
  #banner = element('flags');
  #words = element('flag-words');
  #when = element('flag-when');
  #point = element('flag-point');
  #toggle = element('point');
  /** @type {string | null} the camera that is held to point in its picture */
  #held = null;
  #answers = false; // who is pointed at is so for a flag, not because the operator wished it of who is watched
  #back = false; // what is shown is past, to point at somebody there

  /**
   * @param {Viewer} viewer
   * @param {Pointing} pointing
   */
  constructor(viewer, pointing) {
    this.viewer = viewer;
    this.pointing = pointing;
    this.#point.addEventListener('click', () => this.answer());
    this.#toggle.addEventListener('click', () => this.toggle());
  }

  /** @param {Flag} flag */
  take(flag) {
    this.flags.take(flag);
    const { object } = this.pointing;
    const mine = this.#answers && object !== null && flag.objects.includes(object);
    if (flag.state === 'answered' && mine && !this.flags.about(object, this.#now)) this.#leave();
    this.show();
  }

  /** Point at whom the most urgent flag is about; once more: no more. */
  answer() {
    if (this.pointing.object !== null) return this.#leave();
    const [flag] = this.flags.urgent(this.#now);
    if (flag) this.#answer(flag);
    this.show();
  }

  /** Point at who is watched, whatever flags there are; where nobody is, answer. Once more: no more. */
  toggle() {
    const { viewer, pointing } = this;
    if (pointing.object !== null || viewer.object === null) return this.answer();
    pointing.begin(viewer.object);
    this.#answers = false;
    this.show();
  }

  show() {
    const { flags, pointing, viewer } = this;
    const on = pointing.object !== null;
    // Who follows somebody is told what they are followed through, however urgent others are.
    const { site, probe } = viewer;
    const urgent = flags.urgent(this.#now);
    const flag = on ? flags.about(pointing.object, this.#now) : urgent[0];
    this.#banner.hidden = !flag && !on;
    const target = pointing.object ?? flag?.objects[0] ?? null;
    const follow = on && target !== null ? `Follow ${label(target)}` : '';
    write(this.#words, [follow, flag ? words(flag, label) : ''].filter(Boolean).join(': '));
    write(this.#when, flag && site && probe.pulse !== null ? ` ${when(flag, probe.pulse, site.fps)}` : '');
    this.#point.hidden = this.#toggle.hidden = !pointing.possible;
    write(this.#point, on ? 'Done' : `Point at ${target === null ? '' : label(target)}`);
    this.#toggle.setAttribute('aria-pressed', String(on));
    probe.flags = urgent;
    probe.pointing = { object: pointing.object, accepted: pointing.accepted };
    if (!on && (this.#held !== null || this.#back)) this.#leave();
  }

  /** The first frame of which what is expected there is not past for who looks at the picture. */
  get #now() {
    const { site, probe } = this.viewer;
    return site && probe.pulse !== null ? probe.pulse - NOW_S * site.fps : 0;
  }

  /** @param {Flag} flag to be answered in the picture of the camera that has raised it, as it happens or again */
  #answer({ objects: [object], cameras: [camera], pulse }) {
    const { viewer, pointing } = this;
    const over = pulse < this.#now;
    pointing.begin(object);
    this.#answers = pointing.object !== null;
    if (!this.#answers) return;
    viewer.choose(object);
    if (viewer.override.camera !== camera) {
      viewer.hold(camera);
      this.#held = camera;
    } // else as the operator wished
    if (!over || !viewer.site || viewer.timeShift.moment) return;
    viewer.timeShift.watchFrom(pulse - Math.round(BEFORE_S * viewer.site.fps));
    this.#back = viewer.timeShift.moment !== null; // it stays live where that is as good
  }

  /** What was held to point is let go, unless somebody has held another meanwhile; and what was past is live. */
  #leave() {
    const [held, back] = [this.#held, this.#back];
    this.#held = null;
    this.#back = false;
    if (this.pointing.object !== null) this.pointing.end();
    if (held !== null && this.viewer.override.camera === held) this.viewer.hold(null);
    if (back && this.viewer.timeShift.moment) this.viewer.timeShift.live();
    this.show();
  }
}

/**
 * Only where it is another: what is written is read out.
 *
 * @param {HTMLElement} place
 * @param {string} text
 */
function write(place, text) {
  if (place.textContent !== text) place.textContent = text;
}
