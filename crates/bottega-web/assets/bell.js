// The bell: notifications of the browser when a job is done or has failed, while the page is open.

import { get } from "./api.js";
import { button } from "./format.js";

const LOOK_EVERY = 5000;
/** Where the browser remembers that the bell is on. */
const KEY = "bottega-bell";
const ENDS = ["done", "failed"];

/**
 * The jobs that have ended since the last look. `states` are those of the last look, by number; null: there was none, and what
 * is over was over before. Returns `[ended, states]`.
 */
export function endedJobs(states, jobs) {
  const ended = states === null ? [] : jobs.filter(({ job, state }) => ENDS.includes(state) && states.get(job) !== state);
  return [ended, new Map(jobs.map(({ job, state }) => [job, state]))];
}

/** What a notification of a job says: title and text. */
export function endText({ job, state, scene, output, reason }) {
  return [`Job ${job}: ${state}`, state === "failed" && reason ? reason : `${scene} → ${output}`];
}

const HELP = {
  off: "Have the browser notify you when a job is done or has failed, while this page is open",
  on: "You are notified when a job is done or has failed, while this page is open",
  denied: "The browser blocks notifications of this page: allow them in its settings",
  unsupported: "This browser shows no notifications here: they need https, or an address of this machine",
};

/** The button of the bell. */
export class Bell {
  #states = null;
  #timer = null;

  constructor() {
    this.element = button("Notify me", () => this.#press(), { class: "bell" });
    const isSupported = "Notification" in globalThis && isSecureContext;
    this.#show(isSupported && Notification.permission === "denied" ? "denied" : isSupported ? "off" : "unsupported");
    if (isSupported && Notification.permission === "granted" && localStorage.getItem(KEY) === "on") this.#turnOn();
  }

  #show(state) {
    this.element.title = HELP[state];
    this.element.disabled = state === "unsupported";
    this.element.setAttribute("aria-pressed", String(state === "on"));
  }

  async #press() {
    if (this.#timer !== null) return this.#turnOff();
    const permission = await Notification.requestPermission();
    if (permission === "granted") this.#turnOn();
    else this.#show(permission === "denied" ? "denied" : "off");
  }

  #turnOn() {
    localStorage.setItem(KEY, "on");
    this.#show("on");
    this.#states = null;
    this.#look();
    this.#timer = setInterval(() => this.#look(), LOOK_EVERY);
  }

  #turnOff() {
    localStorage.removeItem(KEY);
    clearInterval(this.#timer);
    this.#timer = null;
    this.#show("off");
  }

  async #look() {
    // While nobody answers nothing is known.
    const jobs = await get("/jobs").catch(() => null);
    if (!jobs) return;
    const [ended, states] = endedJobs(this.#states, jobs);
    this.#states = states;
    for (const job of ended) {
      const [title, body] = endText(job);
      const notification = new Notification(title, { body, tag: `bottega-${job.job}-${job.state}` });
      notification.onclick = () => { focus(); location.hash = `#/job/${job.job}`; };
    }
  }
}
