// When a job will be done, by what was seen of it.

const WINDOW_SECONDS = 90;
const SECONDS_MIN = 4;
const SHARE_MIN = 0.01;

/** Estimates by the speed of the last minute and a half. Says nothing where too little was seen. */
export class TimeLeft {
  #seen = [];

  /** Takes note that at `seconds` the share `done` (0 to 1) of the work was done. */
  take(seconds, done) {
    const last = this.#seen.at(-1);
    if (last && done < last.done) this.#seen = [];
    if (!last || done !== last.done) this.#seen.push({ seconds, done });
    while (this.#seen.length > 2 && this.#seen[1].seconds < seconds - WINDOW_SECONDS) this.#seen.shift();
  }

  /** Begins anew: a pause is no work. */
  clear() { this.#seen = []; }

  /** Seconds that are left at `now`, or null where nothing can be said. */
  left(now) {
    const [first, last] = [this.#seen[0], this.#seen.at(-1)];
    if (!first || last.done - first.done < SHARE_MIN || last.seconds - first.seconds < SECONDS_MIN) return null;
    // Time without progress counts: a job that stands still takes longer.
    const speed = (last.done - first.done) / (Math.max(now, last.seconds) - first.seconds);
    return (1 - last.done) / speed;
  }
}
