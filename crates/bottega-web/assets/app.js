// Which view is shown, and what all views may do beside their own place.

import { Bell } from "./bell.js";
import { element } from "./format.js";
import { showJob } from "./job.js";
import { showJobs } from "./jobs.js";
import { showMachines } from "./machines.js";
import { showMessages } from "./messages.js";
import { showSubmit } from "./submit.js";

const page = document.getElementById("page");
const link = document.getElementById("link");
const problem = document.getElementById("problem");
const question = document.getElementById("question");
let end = () => {};

const shell = {
  /** Says whether the farm answers. */
  link(isUp) { link.textContent = isUp ? "" : "No answer. Trying again …"; },
  /** Shows why something was not done, until something else is. */
  tellProblem(text) {
    problem.hidden = !text;
    problem.textContent = text ?? "";
  },
  /** Does something that a person asked for, and tells why where it is not done. */
  async attempt(work) {
    const result = await shell.poll(work, error => shell.tellProblem(error.message));
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
  end();
  end = () => {};
  page.replaceChildren(element("h1", {}, "A key is needed"),
    element("p", {}, "Open the address that bottega printed, with its ?token=…"));
}

const VIEWS = {
  jobs: { title: "Jobs", show: showJobs },
  job: { title: "Job", show: showJob },
  machines: { title: "Machines", show: showMachines },
  messages: { title: "Messages", show: showMessages },
  submit: { title: "New picture", show: showSubmit },
};

function route(event) {
  const [, name, number] = location.hash.split("/");
  if (location.hash === "#page") return;
  const view = VIEWS[name] ? name : "jobs";
  end();
  shell.tellProblem(null);
  page.replaceChildren();
  document.title = `${VIEWS[view].title}${view === "job" || (view === "messages" && number) ? ` ${number}` : ""} – Bottega`;
  for (const anchor of document.querySelectorAll("nav a")) {
    if (anchor.dataset.view === (view === "job" ? "jobs" : view)) anchor.setAttribute("aria-current", "page");
    else anchor.removeAttribute("aria-current");
  }
  end = VIEWS[view].show(page, shell, number ? Number(number) : undefined);
  if (event) page.focus();
}

document.getElementById("bell").replaceChildren(new Bell().element);
addEventListener("hashchange", route);
route();
