/** A stable color per camera. */

/** Okabe and Ito's for color-blind readers, lightened for a dark background; green is the selected person's. */
const COLORS = ['#56b4e9', '#e69f00', '#cc79a7', '#f0e442', '#4a86d8', '#e0672b', '#b9b9b9'];

export class Palette {
  /** @param {string[]} cameras in the site's order */
  constructor(cameras) {
    this.order = new Map(cameras.map((camera, at) => [camera, at]));
  }

  /**
   * @param {string} camera
   * @returns {string} a CSS color
   */
  color(camera) {
    const at = this.order.get(camera) ?? COLORS.length - 1;
    return COLORS[at % COLORS.length];
  }
}
