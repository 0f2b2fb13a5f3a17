/** A canvas at the screen's pixel density, drawn on in CSS pixels. */

export class Surface {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext('2d'));
    this.width = 0;
    this.height = 0;
    // Reading the size at every frame would force a layout at every frame.
    new ResizeObserver(([entry]) => {
      this.width = entry.contentRect.width;
      this.height = entry.contentRect.height;
    }).observe(canvas);
  }

  /** @returns {CanvasRenderingContext2D} cleared, scaled to CSS pixels */
  clear() {
    const density = window.devicePixelRatio || 1;
    const width = Math.round(this.width * density);
    const height = Math.round(this.height * density);
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    this.context.setTransform(1, 0, 0, 1, 0, 0);
    this.context.clearRect(0, 0, width, height);
    this.context.setTransform(density, 0, 0, density, 0, 0);
    return this.context;
  }
}
