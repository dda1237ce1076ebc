// All jobs, with their pictures, their progress and what can be done to them.

import { fetchPicture, get } from "./api.js";
import { ago, button, counted, element, setText } from "./format.js";
import { JobControls, progress, stateChip } from "./job_controls.js";

const LOOK_EVERY = 1000;
const PICTURE_EVERY = 5000;
/** Jobs that are shown at once; more on demand. */
const PAGE_JOBS = 50;

/** Whether a job is one of those looked for. `text` is words of which each must be in one of its names. */
export function isWanted(job, text, state) {
  if (state && job.state !== state) return false;
  const names = `${job.job} ${job.scene} ${job.output} ${job.from} ${job.leader ?? ""}`.toLowerCase();
  return text.toLowerCase().split(/\s+/).every(word => names.includes(word));
}

const ORDERS = {
  newest: { name: "Newest first", compare: (a, b) => b.job - a.job },
  priority: { name: "Most urgent first", compare: (a, b) => b.priority - a.priority || b.job - a.job },
  progress: { name: "Least done first", compare: (a, b) => a.done - b.done || b.job - a.job },
};

export function showJobs(page, shell) {
  let [jobs, shownMax] = [[], PAGE_JOBS];
  const cards = new Map();
  const text = element("input", { type: "search", placeholder: "Scene, picture, machine …", ariaLabel: "Filter jobs", oninput: () => show() });
  const state = element("select", { ariaLabel: "State", onchange: () => show() }, element("option", { value: "" }, "All states"),
    ["active", "paused", "done", "failed", "cancelled"].map(word => element("option", {}, word)));
  const order = element("select", { ariaLabel: "Order", onchange: () => show() },
    Object.entries(ORDERS).map(([value, { name }]) => element("option", { value }, name)));
  const count = element("p", { class: "quiet", role: "status" });
  const list = element("ul", { class: "jobs" });
  const more = button("Show more", () => { shownMax += PAGE_JOBS; show(); }, { hidden: true });
  const empty = element("p", { class: "empty-note", hidden: true });
  page.replaceChildren(element("h1", {}, "Jobs"), element("div", { class: "row filter" }, text, state, order, count), list, more, empty);

  function show() {
    const wanted = jobs.filter(job => isWanted(job, text.value, state.value)).sort(ORDERS[order.value].compare);
    const shown = wanted.slice(0, shownMax);
    const numbers = new Set(shown.map(job => job.job));
    for (const [number, card] of cards) if (!numbers.has(number)) { card.close(); cards.delete(number); }
    shown.forEach((job, i) => {
      if (!cards.has(job.job)) cards.set(job.job, new JobCard(shell, job.job, look));
      const card = cards.get(job.job);
      card.set(job);
      if (list.children[i] !== card.element) list.insertBefore(card.element, list.children[i] ?? null);
    });
    more.hidden = wanted.length <= shownMax;
    setText(count, wanted.length === jobs.length ? counted(jobs.length, "job") : `${wanted.length} of ${counted(jobs.length, "job")}`);
    empty.hidden = wanted.length > 0;
    setText(empty, jobs.length ? "No job matches." : "No jobs yet. Drop a scene into “New picture”, or run: bottega render SCENE -o PICTURE --farm");
  }

  async function look() {
    const found = await shell.poll(() => get("/jobs"));
    if (!found) return;
    jobs = found;
    show();
  }
  look();
  const timer = setInterval(look, LOOK_EVERY);
  return () => {
    clearInterval(timer);
    for (const card of cards.values()) card.close();
  };
}

class JobCard {
  #seen = "";
  #at = 0;
  #tag = null;
  #isVisible = false;

  constructor(shell, number, onGone) {
    this.number = number;
    this.image = element("img", { alt: "", hidden: true });
    this.link = element("a", { href: `#/job/${number}` });
    this.chip = stateChip();
    this.bar = progress();
    this.facts = element("p", { class: "quiet" });
    this.controls = new JobControls(shell, { onGone });
    this.element = element("li", {},
      element("a", { class: "thumb", href: `#/job/${number}`, tabIndex: -1, "aria-hidden": "true" }, this.image),
      element("div", { class: "card" }, element("div", { class: "row" }, element("h2", {}, this.link), this.chip), this.bar, this.facts),
      this.controls.element);
    this.observer = new IntersectionObserver(([entry]) => { this.#isVisible = entry.isIntersecting; });
    this.observer.observe(this.element);
  }

  set(job) {
    setText(this.link, `${job.job}: ${job.scene}`);
    this.chip.set(job.state);
    this.bar.set(job.done, `job ${job.job}`);
    setText(this.facts, [job.zones ? `${job.zones_done} of ${job.zones} zones` : "not cut into zones yet", ["active", "paused"].includes(job.state) ? counted(job.machines, "machine") : null, `submitted ${ago(job.submitted)}`, job.output, job.reason]
      .filter(Boolean).join(" · "));
    this.controls.set(job);
    this.#renewPicture(job);
  }

  close() {
    this.observer.disconnect();
    this.element.remove();
    if (this.image.src) URL.revokeObjectURL(this.image.src);
  }

  /** Only of cards that are seen, and only where something was painted since. */
  async #renewPicture(job) {
    const isPainted = job.kept || (["active", "paused"].includes(job.state) && (job.seen || job.zones_done > 0));
    const key = `${job.state} ${job.seen} ${job.zones_done}`;
    if (!this.#isVisible || !isPainted || key === this.#seen || Date.now() - this.#at < PICTURE_EVERY) return;
    [this.#seen, this.#at] = [key, Date.now()];
    const found = await fetchPicture(`/jobs/${this.number}/preview.png`, this.#tag);
    if (!found) return;
    this.#tag = found.tag;
    if (this.image.src) URL.revokeObjectURL(this.image.src);
    this.image.src = URL.createObjectURL(found.blob);
    this.image.hidden = false;
  }
}
