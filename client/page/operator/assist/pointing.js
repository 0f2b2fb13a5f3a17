/**
 * The operator points at somebody: whatever moves the pointer, a mouse, a finger, a pen, an eye.
 *
 * While it is on, every frame that is shown becomes a place, as long as the pointer is over the picture; of a
 * finger, as long as it is down. A press is one more. Arrows move the cross, and Enter is a press.
 */

import { Refused, ask } from '../requests.js';
import { Samples } from './pointing_samples.js';

/** @import {Overlay} from '../../player/overlay.js' */
/** @import {Viewer} from '../../viewer.js' */

const SEND_MS = 100;
const REACH = { touch: 24, other: 12 }; // CSS pixels that a finger, and anything else, may be off
const STEP = 8; // CSS pixels that an arrow moves the cross by; with shift four times as far
/** @type {Record<string, [number, number]>} */
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** @typedef {{x: number, y: number, tolerance: number}} Place CSS pixels from the corner of the stage */

export class Pointing {
  /** @type {number | null} at whom; null: it is off */
  object = null;
  /** The server lets whoever looks at this page point, and its cameras take it. */
  possible = false;
  /** Places that the server has taken. */
  accepted = 0;
  /** @type {Place | null} where the pointer is; null: not over the picture */
  #at = null;
  #samples = new Samples();
  #sending = false;

  /**
   * @param {HTMLElement} stage
   * @param {HTMLElement} cross
   * @param {Viewer} viewer
   * @param {Overlay} overlay
   * @param {(error: unknown) => void} tell what went wrong; null: nothing
   */
  constructor(stage, cross, viewer, overlay, tell) {
    this.stage = stage;
    this.cross = cross;
    this.viewer = viewer;
    this.overlay = overlay;
    this.tell = tell;
    stage.addEventListener('pointermove', (event) => this.#move(event, event.pointerType === 'touch' && !event.buttons));
    stage.addEventListener('pointerdown', (event) => this.#press(event));
    stage.addEventListener('pointerleave', () => this.#put(null));
    for (const name of ['pointerup', 'pointercancel']) {
      stage.addEventListener(name, (event) => {
        if (/** @type {PointerEvent} */ (event).pointerType === 'touch') this.#put(null);
      });
    }
    document.addEventListener('keydown', (event) => this.#key(event), { capture: true });
    setInterval(() => void this.#send(), SEND_MS);
  }

  /** Ask whether the server would take it. */
  async look() {
    this.possible = await ask('position_corrections').then(({ unavailable }) => unavailable === '', () => false);
    if (!this.possible) this.end();
  }

  /** @param {number} object whom to point at from now on */
  begin(object) {
    if (!this.possible) return;
    this.object = object;
    this.stage.classList.add('pointing');
  }

  end() {
    this.object = null;
    this.stage.classList.remove('pointing');
    this.#put(null);
  }

  /** A frame is shown: whom the pointer is on is there in it. */
  frame() {
    if (this.#at) this.#sample(this.#at);
  }

  /**
   * @param {PointerEvent} event
   * @param {boolean} [gone] it is over the picture no more
   */
  #move({ clientX, clientY, pointerType }, gone = false) {
    if (this.object === null) return;
    const { left, top } = this.stage.getBoundingClientRect();
    const tolerance = pointerType === 'touch' ? REACH.touch : REACH.other;
    this.#put(gone ? null : { x: clientX - left, y: clientY - top, tolerance });
  }

  /** @param {PointerEvent} event */
  #press(event) {
    if (this.object === null || (event.target instanceof Element && event.target.closest('button'))) return;
    this.#move(event);
    if (this.#at) this.#sample(this.#at);
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const { key, shiftKey, target } = event;
    if (this.object === null || event.ctrlKey || event.metaKey || event.altKey) return;
    const pressed = target instanceof Element && target.closest('button, a, summary, select, input');
    if (key in ARROWS) {
      const [x, y] = ARROWS[key].map((way) => way * STEP * (shiftKey ? 4 : 1));
      const at = this.#at ?? this.#start();
      const { width, height } = this.stage.getBoundingClientRect();
      this.#put({ x: within(at.x + x, width), y: within(at.y + y, height), tolerance: REACH.other });
    } else if (key === 'Enter' && !pressed && this.#at) this.#sample(this.#at);
    else if (key === 'Escape') this.end();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  /** @returns {Place} where the cross begins: on the one who is pointed at, if they are in the picture */
  #start() {
    const { site, currentFrame } = this.viewer;
    const { width, height } = this.stage.getBoundingClientRect();
    const box = currentFrame.boxes.find(([object]) => object === this.object);
    if (!site || !box) return { x: width / 2, y: height / 2, tolerance: REACH.other };
    const [, left, top, right, bottom] = box;
    return { ...this.overlay.toCanvas((left + right) / 2, (top + bottom) / 2, site), tolerance: REACH.other };
  }

  /** @param {Place | null} at */
  #put(at) {
    this.#at = at;
    this.cross.hidden = at === null;
    if (at) this.cross.style.transform = `translate(${at.x}px, ${at.y}px)`;
  }

  /** @param {Place} at in the frame that is shown */
  #sample({ x, y, tolerance }) {
    const { site, probe, currentFrame, player } = this.viewer;
    if (this.object === null || !site || !currentFrame.mapped || player.switching) return;
    if (probe.pulse === null || probe.camera === null) return;
    const { scale, ...place } = this.overlay.toPicture(x, y, site);
    if (!(place.x >= 0 && place.x <= site.width && place.y >= 0 && place.y <= site.height)) return;
    this.#samples.add(this.object, probe.camera, { pulse: probe.pulse, ...place, tolerance: tolerance / scale });
  }

  async #send() {
    if (this.#sending) return;
    this.#sending = true;
    try {
      for (let said = this.#samples.take(); said; said = this.#samples.take()) {
        const { accepted } = await ask('position_corrections', 'POST', said);
        this.accepted += accepted;
        this.tell(null);
      }
    } catch (error) {
      this.tell(error);
      if (error instanceof Refused && [401, 403].includes(error.status)) this.possible = false;
    } finally {
      this.#sending = false;
    }
  }
}

/**
 * @param {number} value
 * @param {number} most
 */
function within(value, most) {
  return Math.min(Math.max(value, 0), most);
}
