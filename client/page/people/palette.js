/**
 * A stable colour per camera, told apart by the colour-blind too: Okabe and Ito's, lightened for a
 * dark ground, without their green, which is the chosen person's here.
 */

const COLOURS = ['#56b4e9', '#e69f00', '#cc79a7', '#f0e442', '#4a86d8', '#e0672b', '#b9b9b9'];

export class Palette {
  /** @param {string[]} cameras in the site's order */
  constructor(cameras) {
    this.order = new Map(cameras.map((camera, at) => [camera, at]));
  }

  /**
   * @param {string} camera
   * @returns {string} a CSS colour
   */
  colour(camera) {
    const at = this.order.get(camera) ?? COLOURS.length - 1;
    return COLOURS[at % COLOURS.length];
  }
}
