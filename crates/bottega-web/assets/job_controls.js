// What is shown of a job, and done to it, in the list of jobs and in its own view.

import { ask, isOnePicture } from "./api.js";
import { button, element, percent, setText } from "./format.js";

export const PRIORITY_MAX = 1000;

/** A progress bar with its number: `set(share, of)`. */
export function progress() {
  const bar = element("progress", { max: 1, value: 0 });
  const number = element("span", { class: "percent" });
  const both = element("div", { class: "progress" }, bar, number);
  both.set = (done, of) => {
    bar.value = done;
    bar.ariaLabel = `Progress of ${of}`;
    setText(number, percent(done));
  };
  return both;
}

/** The state of a job, in a color: `set(state)`. */
export function stateChip() {
  const chip = element("span", { class: "chip" });
  chip.set = state => {
    setText(chip, state === "cancelled" && isOnePicture() ? "stopped" : state);
    chip.dataset.state = state;
  };
  return chip;
}

/** Pause, resume, cancel, remove and priority of a job. */
export class JobControls {
  #state = null;

  constructor(shell, { onGone }) {
    Object.assign(this, { shell, onGone });
    this.priority = element("input", { type: "number", min: 1, max: PRIORITY_MAX, required: true, onchange: () => this.#setPriority() });
    const help = "1 to 1000: jobs have machines in proportion to their priorities";
    this.label = element("label", { title: help }, "Priority ", this.priority);
    this.buttons = element("span", { class: "row" });
    this.element = element("div", { class: "row controls steers" }, this.buttons, this.label);
  }

  set(job) {
    this.job = job;
    if (document.activeElement !== this.priority) this.priority.value = job.priority;
    if (this.#state === job.state) return;
    this.#state = job.state;
    const make = (word, work, properties = {}) =>
      button(word, work, { ariaLabel: `${word} job ${job.job}`, ...properties });
    const isOver = !["active", "paused"].includes(job.state);
    this.label.hidden = isOver || isOnePicture();
    if (isOnePicture()) {
      this.buttons.replaceChildren(...(isOver ? [] : [button("Stop", () => this.#stop())]));
      return;
    }
    this.buttons.replaceChildren(...[
      job.state === "active" ? make("Pause", () => this.#do("pause")) : null,
      job.state === "paused" ? make("Resume", () => this.#do("resume")) : null,
      isOver ? make("Remove", () => this.#remove()) : make("Cancel", () => this.#cancel()),
    ].filter(Boolean));
  }

  async #do(order) {
    const job = await this.shell.attempt(() => ask("POST", `/jobs/${this.job.job}/${order}`), this.element);
    if (job) this.set(job);
  }

  async #stop() {
    const text = "Stop painting? What is painted so far is written, and the same command with --resume continues it.";
    if (await this.shell.confirm(text, "Stop")) await this.#do("cancel");
  }

  async #cancel() {
    const { job, scene } = this.job;
    if (await this.shell.confirm(`Cancel job ${job}, ${scene}? It cannot be resumed.`, "Cancel the job")) await this.#do("cancel");
  }

  async #remove() {
    const { job, scene } = this.job;
    if (!await this.shell.confirm(`Remove job ${job}, ${scene}? The farm deletes its picture, too.`, "Remove")) return;
    const isDone = await this.shell.attempt(async () => { await ask("DELETE", `/jobs/${job}`); return true; }, this.element);
    if (isDone) this.onGone(job);
  }

  async #setPriority() {
    if (!this.priority.reportValidity()) return;
    const priority = Number(this.priority.value);
    const job = await this.shell.attempt(() => ask("PUT", `/jobs/${this.job.job}/priority`, { priority }), this.element);
    if (job) this.set(job);
  }
}
