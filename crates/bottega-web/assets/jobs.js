// All jobs, with their progress and what can be done to them.

import { ask, get } from "./api.js";
import { ago, element, percent, table } from "./format.js";

const LOOK_EVERY = 1000;

/** The buttons of a job. */
export function buttons(job, shell, done) {
  const button = (word, method, path) => element("button", {
    type: "button",
    onclick: async () => { await shell.attempt(() => ask(method, `/jobs/${job.job}${path}`)); done(); },
  }, word);
  if (job.state === "active") return [button("Pause", "POST", "/pause"), button("Cancel", "POST", "/cancel")];
  if (job.state === "paused") return [button("Resume", "POST", "/resume"), button("Cancel", "POST", "/cancel")];
  return [button("Remove", "DELETE", "")];
}

export function progress(job) {
  return element("progress", { max: 1, value: job.done, "aria-label": `job ${job.job}: ${percent(job.done)}` });
}

export function showJobs(page, shell) {
  const place = element("div");
  page.replaceChildren(element("h1", {}, "Jobs"), place);
  const look = async () => {
    const jobs = await shell.attempt(() => get("/jobs"));
    // A button under the pointer stays.
    if (!jobs || place.querySelector("button:active")) return;
    const row = job => [
      element("a", { href: `#/job/${job.job}` }, `${job.job}`),
      job.scene, job.state, element("span", {}, progress(job), ` ${percent(job.done)}`),
      `${job.machines}`, `${job.priority}`, ago(job.submitted), element("span", {}, buttons(job, shell, look)),
    ];
    place.replaceChildren(jobs.length
      ? table(["Job", "Scene", "State", "Done", "Machines", "Priority", "Asked", ""], jobs.slice().reverse().map(row))
      : element("p", {}, "No jobs yet: bottega render SCENE -o PICTURE --farm"));
  };
  look();
  const timer = setInterval(look, LOOK_EVERY);
  return () => clearInterval(timer);
}
