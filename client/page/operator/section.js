/** What the sections of the operator's page have in common. */

/** @typedef {(error: unknown) => void} ShowError null: no error */

/**
 * @typedef {object} Section of the page
 * @property {() => void} open called when it is shown
 * @property {() => void} close called when it is hidden
 * @property {boolean} [isUnsaved] whether something was entered that would be lost with the page
 */

/** Repeats an asynchronous action at intervals, between start() and stop(), while the page is visible. */
export class Repeater {
  #run = 0;

  /**
   * @param {() => Promise<void>} action
   * @param {number} intervalMs
   * @param {ShowError} showError
   */
  constructor(action, intervalMs, showError) {
    this.action = action;
    this.intervalMs = intervalMs;
    this.showError = showError;
  }

  start() {
    void this.#loop((this.#run += 1));
  }

  stop() {
    this.#run += 1;
  }

  /** @param {number} run ends when another is started, or it is stopped */
  async #loop(run) {
    let failed = false;
    while (run === this.#run) {
      try {
        if (!document.hidden) await this.action();
        if (failed && run === this.#run) this.showError(null);
        failed = false;
      } catch (error) {
        failed = true;
        if (run === this.#run) this.showError(error);
      }
      await new Promise((resolve) => setTimeout(resolve, this.intervalMs));
    }
  }
}
