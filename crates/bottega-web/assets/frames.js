// The frames of an animation, each of which is a job.

import { get } from "./api.js";
import { button, element, setText } from "./format.js";

const LOOK_EVERY = 3000;
/** Between two downloads, so that the browser takes all. */
const DOWNLOAD_EVERY = 400;

/** The jobs of the animation that a job belongs to, by frame. */
export function framesOf(jobs, job) {
  const own = jobs.filter(it => it.animation?.animation === job.animation?.animation);
  return job.animation ? own.sort((a, b) => a.animation.frame - b.animation.frame) : [];
}

/** Leads from frame to frame. Shows nothing for a job that is not a frame. */
export class FrameStrip {
  #jobs = [];
  #number = null;
  #at = 0;

  constructor(shell) {
    this.shell = shell;
    this.slider = element("input", { type: "range", min: 0, value: 0, ariaLabel: "Frame", onchange: () => this.#go(Number(this.slider.value)) });
    this.text = element("span", { role: "status" });
    this.element = element("div", { class: "row frames", hidden: true },
      button("◀", () => this.#step(-1), { ariaLabel: "Frame before" }), this.slider, button("▶", () => this.#step(1), { ariaLabel: "Next frame" }),
      this.text, button("Download all frames", () => this.#download()));
  }

  /** Shows where a job stands among its frames. */
  async set(job) {
    if (!job.animation || (this.#jobs.length && Date.now() - this.#at < LOOK_EVERY)) return;
    this.#at = Date.now();
    const jobs = await this.shell.poll(() => get("/jobs"));
    if (!jobs) return;
    this.#jobs = framesOf(jobs, job);
    this.#number = job.job;
    const done = this.#jobs.filter(it => it.state === "done").length;
    this.element.hidden = false;
    this.slider.max = this.#jobs.length - 1;
    this.slider.value = this.#place;
    setText(this.text, `Frame ${job.animation.frame}: ${done} of ${job.animation.frames} frames are done`);
  }

  get #place() { return this.#jobs.findIndex(it => it.job === this.#number); }

  #step(by) { this.#go(this.#place + by); }

  #go(place) {
    const job = this.#jobs[Math.max(0, Math.min(this.#jobs.length - 1, place))];
    if (job && job.job !== this.#number) location.hash = `#/job/${job.job}`;
  }

  async #download() {
    for (const job of this.#jobs.filter(it => it.kept)) {
      element("a", { href: `/api/jobs/${job.job}/picture`, download: "" }).click();
      await new Promise(done => setTimeout(done, DOWNLOAD_EVERY));
    }
  }
}
