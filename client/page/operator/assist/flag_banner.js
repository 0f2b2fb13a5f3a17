/** The line at the top of the picture: the most urgent flag, and the button to answer it by pointing. */

import { element, setText } from '../../shared/dom.js';
import { describeFlag, describeTime, NOW_S, OpenFlags } from './flag_priority.js';
import { shortLabel } from '../../people/names.js';

/** @import {Flag} from '../../shared/api_types.js' */
/** @import {Pointing} from './pointing.js' */
/** @import {Viewer} from '../../viewer.js' */

const LEAD_IN_S = 1; // a past event is played again from this long before it

export class FlagBanner {
  flags = new OpenFlags();
  #banner = element('flags');
  #text = element('flag-text');
  #time = element('flag-time');
  #answerButton = element('flag-point');
  #pointButton = element('point');
  /** @type {string | null} the camera held for pointing */
  #heldCamera = null;
  #answering = false; // pointing answers a flag; false: the operator points at the selected person
  #wentBack = false; // the past is played for pointing

  /**
   * @param {Viewer} viewer
   * @param {Pointing} pointing
   */
  constructor(viewer, pointing) {
    this.viewer = viewer;
    this.pointing = pointing;
    this.#answerButton.addEventListener('click', () => this.toggleAnswer());
    this.#pointButton.addEventListener('click', () => this.togglePointing());
  }

  /** @param {Flag} flag */
  update(flag) {
    this.flags.update(flag);
    const { object } = this.pointing;
    const answered = flag.state === 'answered' && this.#answering && object !== null && flag.objects.includes(object);
    if (answered && !this.flags.mostUrgentOf(object, this.#now)) this.#stop();
    this.show();
  }

  /** Start pointing at the person of the most urgent flag, or stop pointing. */
  toggleAnswer() {
    if (this.pointing.object !== null) return this.#stop();
    const [flag] = this.flags.byUrgency(this.#now);
    if (flag) this.#answer(flag);
    this.show();
  }

  /** Start pointing at the selected person (without one, answer the most urgent flag), or stop pointing. */
  togglePointing() {
    const { viewer, pointing } = this;
    if (pointing.object !== null || viewer.object === null) return this.toggleAnswer();
    pointing.begin(viewer.object);
    this.#answering = false;
    this.show();
  }

  show() {
    const { flags, pointing, viewer } = this;
    const { site, probe } = viewer;
    const on = pointing.object !== null;
    const byUrgency = flags.byUrgency(this.#now);
    // While pointing, the banner shows the person's own flag, even if others are more urgent.
    const flag = on ? flags.mostUrgentOf(pointing.object, this.#now) : byUrgency[0];
    this.#banner.hidden = !flag && !on;
    const target = pointing.object ?? flag?.objects[0] ?? null;
    const follow = on && target !== null ? `Follow ${shortLabel(target)}` : '';
    setText(this.#text, [follow, flag ? describeFlag(flag, shortLabel) : ''].filter(Boolean).join(': '));
    setText(this.#time, flag && site && probe.pulse !== null ? ` ${describeTime(flag, probe.pulse, site.fps)}` : '');
    this.#answerButton.hidden = this.#pointButton.hidden = !pointing.available;
    setText(this.#answerButton, on ? 'Done' : `Point at ${target === null ? '' : shortLabel(target)}`);
    this.#pointButton.setAttribute('aria-pressed', String(on));
    probe.flags = byUrgency;
    probe.pointing = { object: pointing.object, accepted: pointing.accepted };
    if (!on && (this.#heldCamera !== null || this.#wentBack)) this.#stop();
  }

  /** The pulse before which events count as past at the displayed frame. */
  get #now() {
    const { site, probe } = this.viewer;
    return site && probe.pulse !== null ? probe.pulse - NOW_S * site.fps : 0;
  }

  /** @param {Flag} flag to answer in the picture of its camera, live or in the past */
  #answer({ objects: [object], cameras: [camera], pulse }) {
    const { viewer, pointing } = this;
    const past = pulse < this.#now;
    pointing.begin(object);
    this.#answering = pointing.object !== null;
    if (!this.#answering) return;
    viewer.select(object);
    if (viewer.preference.camera !== camera) {
      viewer.hold(camera);
      this.#heldCamera = camera;
    }
    if (!past || !viewer.site || viewer.timeShift.moment) return;
    viewer.timeShift.watchFrom(pulse - Math.round(LEAD_IN_S * viewer.site.fps));
    this.#wentBack = viewer.timeShift.moment !== null; // null: recent enough to stay live
  }

  /** Stop pointing; release the camera held for it, unless another was held since, and return to live. */
  #stop() {
    const [heldCamera, wentBack] = [this.#heldCamera, this.#wentBack];
    this.#heldCamera = null;
    this.#wentBack = false;
    if (this.pointing.object !== null) this.pointing.end();
    if (heldCamera !== null && this.viewer.preference.camera === heldCamera) this.viewer.hold(null);
    if (wentBack && this.viewer.timeShift.moment) this.viewer.timeShift.live();
    this.show();
  }
}
