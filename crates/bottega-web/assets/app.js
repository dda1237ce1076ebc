// Which view is shown, and what all views may do beside their own place.

import { about, get, isOnePicture } from "./api.js";
import { Bell } from "./bell.js";
import { element } from "./format.js";
import { showJob } from "./job.js";
import { showJobs } from "./jobs.js";
import { showMachines } from "./machines.js";
import { showMessages } from "./messages.js";
import { showSubmit } from "./submit.js";

const TRY_AGAIN = 1000;

const page = document.getElementById("page");
const link = document.getElementById("link");
const problem = document.getElementById("problem");
const question = document.getElementById("question");
/** The problem beside what caused it. */
const beside = element("p", { class: "problem", role: "alert" });
let end = () => {};
/** Counts the views that were opened: one that is left is not shown. */
let views = 0;

const shell = {
  /** Says whether the farm answers. */
  link(isUp) { link.textContent = isUp ? "" : "No answer. Trying again …"; },
  /** Shows why something was not done, until something else is: in `place`, where what caused it is; without, above the page. */
  tellProblem(text, place) {
    const isBeside = Boolean(text && place?.isConnected);
    problem.hidden = !text || isBeside;
    problem.textContent = problem.hidden ? "" : text;
    beside.remove();
    if (!isBeside) return;
    beside.textContent = text;
    place.append(beside);
  },
  /** Carries out a request of the user; shows in `place` why it failed, if it did. */
  async attempt(work, place) {
    const result = await shell.poll(work, error => shell.tellProblem(error.message, place));
    if (result !== undefined) shell.tellProblem(null);
    return result;
  },
  /** Asks for something again and again; what fails is tried again. */
  async poll(work, tell = error => { link.textContent = error.message; }) {
    try {
      const result = await work();
      shell.link(true);
      return result;
    } catch (error) {
      if (error.status === undefined) shell.link(false);
      else if (error.status === 401) askForToken();
      else tell(error);
      return undefined;
    }
  },
  /** Asks before something that cannot be undone. */
  confirm(text, word) {
    question.querySelector("#question-text").textContent = text;
    question.querySelector("[value=yes]").textContent = word;
    question.returnValue = "no";
    question.showModal();
    return new Promise(answer => question.addEventListener("close", () => answer(question.returnValue === "yes"), { once: true }));
  },
};

function askForToken() {
  views++;
  end();
  end = () => {};
  page.replaceChildren(element("h1", {}, "A key is needed"),
    element("p", {}, "Open the address that bottega printed, with its ?token=…"));
}

const VIEWS = {
  jobs: { title: "Jobs", show: showJobs },
  job: { title: "Job", show: showJob, needsJob: true },
  machines: { title: "Machines", show: showMachines },
  messages: { title: "Messages", show: showMessages },
  submit: { title: "New picture", show: showSubmit },
};

/** The view that an address names. Of one picture there is its job, and what its agents say. */
function viewOf(hash) {
  const [, name, number] = hash.split("/");
  if (!isOnePicture()) return [VIEWS[name] ? name : "jobs", number];
  return name === "messages" ? [name, number ?? "1"] : ["job", name === "job" ? number : "1"];
}

/** Looks up the job of a view. Returns the title of the view; null: there is no such job; undefined: the view was left. */
async function isKnown(number, isLeft) {
  for (;;) {
    let isUnknown = !/^\d{1,9}$/.test(number ?? "");
    const job = isUnknown ? null : await shell.poll(() => get(`/jobs/${number}`), error => { isUnknown = error.status === 404; });
    if (isLeft()) return undefined;
    if (job || isUnknown) return Boolean(job);
    await new Promise(done => setTimeout(done, TRY_AGAIN));
    if (isLeft()) return undefined;
  }
}

function showUnknown(number) {
  const [where, all] = isOnePicture() ? ["#/job/1", "The picture of this process"] : ["#/", "All jobs"];
  const why = isOnePicture() ? "This process paints one picture, which is job 1." : "It was removed, or there never was one of this number.";
  page.replaceChildren(element("h1", {}, number === undefined ? "No job is named" : `There is no job ${number}`), element("p", {}, why),
    element("p", {}, element("a", { class: "button", href: where }, all)));
}

async function route(event) {
  if (location.hash === "#page") return;
  const [view, number] = viewOf(location.hash);
  const { title, show, needsJob } = VIEWS[view];
  const of = ++views;
  end();
  end = () => {};
  shell.tellProblem(null);
  page.replaceChildren(element("p", { class: "quiet" }, "Loading …"));
  document.title = `${title}${number !== undefined && !isOnePicture() ? ` ${number}` : ""} – Bottega`;
  for (const anchor of document.querySelectorAll("nav a")) {
    if (anchor.dataset.view === (view === "job" && !isOnePicture() ? "jobs" : view)) anchor.setAttribute("aria-current", "page");
    else anchor.removeAttribute("aria-current");
  }
  if (needsJob || number !== undefined) {
    const known = await isKnown(number, () => of !== views);
    if (known === undefined) return;
    if (!known) {
      showUnknown(number);
      return;
    }
  }
  page.replaceChildren();
  end = show(page, shell, number === undefined ? undefined : Number(number));
  if (!event) return;
  page.focus({ preventScroll: true });
  scrollTo(0, 0);
}

/** Asks who answers, until somebody does. */
async function start() {
  for (;;) {
    const found = await shell.poll(() => get("/about"));
    if (found) Object.assign(about, found);
    if (found || views > 0) break;
    await new Promise(done => setTimeout(done, TRY_AGAIN));
  }
  document.body.classList.toggle("one-picture", isOnePicture());
  if (views > 0) return;
  document.getElementById("version").textContent = `Bottega ${about.version}`;
  document.getElementById("bell").replaceChildren(new Bell().element);
  addEventListener("hashchange", route);
  route();
}

start();
