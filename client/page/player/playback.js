/** Starts a video, and detects when something else starts it: the browser, a picture-in-picture window, a media key. */

export class Playback {
  #startedByPage = false;
  #announced = false; // whether the event `play` has been dispatched, which is some time after the start

  /**
   * @param {HTMLVideoElement} video
   * @param {() => void} resumed called when the video starts without the page having started it
   */
  constructor(video, resumed) {
    this.video = video;
    video.addEventListener('play', () => {
      const startedByPage = this.#startedByPage;
      this.#startedByPage = false;
      this.#announced = true;
      if (!startedByPage) resumed();
    });
    video.addEventListener('pause', () => (this.#announced = false));
  }

  /** @returns {boolean} whether the video is paused, or a start has not been announced yet */
  get paused() {
    return this.video.paused || !this.#announced;
  }

  /** Start the video at its current position. */
  start() {
    if (!this.video.paused) return;
    this.#startedByPage = true;
    this.video.play().catch(() => (this.#startedByPage = false)); // autoplay refused: the page shows "Paused"
  }
}
