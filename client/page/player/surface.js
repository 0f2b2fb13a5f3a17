/** A canvas that keeps the sharpness of the screen and is measured in CSS pixels. */

export class Surface {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext('2d'));
    this.width = 0;
    this.height = 0;
    // Asking for the size at every frame would make the browser lay the page out at every frame.
    new ResizeObserver(([entry]) => {
      this.width = entry.contentRect.width;
      this.height = entry.contentRect.height;
    }).observe(canvas);
  }

  /** @returns {CanvasRenderingContext2D} empty, in CSS pixels */
  clear() {
    const sharpness = window.devicePixelRatio || 1;
    const width = Math.round(this.width * sharpness);
    const height = Math.round(this.height * sharpness);
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    this.context.setTransform(1, 0, 0, 1, 0, 0);
    this.context.clearRect(0, 0, width, height);
    this.context.setTransform(sharpness, 0, 0, sharpness, 0, 0);
    return this.context;
  }
}
