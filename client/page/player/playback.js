/** Starts a video, and detects when something else starts it: the browser, a picture-in-picture window, a media key. */

export class Playback {
  #startedByPage = false;

  /**
   * @param {HTMLVideoElement} video
   * @param {() => void} resumed called when the video starts without the page having started it
   */
  constructor(video, resumed) {
    this.video = video;
    video.addEventListener('play', () => {
      const startedByPage = this.#startedByPage;
      this.#startedByPage = false;
      if (!startedByPage) resumed();
    });
  }

  /** Start the video at its current position. */
  start() {
    if (!this.video.paused) return;
    this.#startedByPage = true;
    this.video.play().catch(() => (this.#startedByPage = false)); // autoplay refused: the page shows "Paused"
  }
}
