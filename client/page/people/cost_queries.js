/** When the numbers behind a view are asked for: by the button of the present view, under the mouse of another. */

/** @import {Strip} from '../timeline/band.js' */
/** @import {Viewer} from '../viewer.js' */
/** @import {Why} from './selection_costs.js' */

export class Explaining {
  on = false;
  #decisions;

  /**
   * @param {Viewer} viewer
   * @param {Strip} strip
   * @param {Why} why
   */
  constructor(viewer, strip, why) {
    this.viewer = viewer;
    this.strip = strip;
    this.why = why;
    this.#decisions = viewer.decisions;
    const { canvas } = strip.surface;
    canvas.addEventListener('pointermove', ({ offsetX, pointerType }) => {
      if (pointerType === 'mouse') this.#about(strip.pulseAt(offsetX));
    });
    canvas.addEventListener('pointerleave', () => this.on || why.hide());
  }

  toggle() {
    this.on = !this.on;
    this.why.place.classList.toggle('stays', this.on);
    if (this.on) this.#about(this.viewer.probe.pulse);
    else this.why.hide();
  }

  /** Another frame is shown, and the mouse is not asking about another one. */
  follow() {
    if (this.on && !this.strip.surface.canvas.matches(':hover')) this.#about(this.viewer.probe.pulse);
  }

  /** @param {number | null} pulse */
  #about(pulse) {
    const { site, object, probe, decisions } = this.viewer;
    if (decisions !== this.#decisions) this.why.forget(); // the pulses began anew
    this.#decisions = decisions;
    if (!site || object === null || pulse === null || probe.pulse === null) return this.why.hide();
    const ago = (probe.pulse - pulse) / site.fps;
    this.why.show(object, pulse, site.gop, ago < site.gop / site.fps ? 'Now' : `${ago.toFixed(1)} s before`);
  }
}
