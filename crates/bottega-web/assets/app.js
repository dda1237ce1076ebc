// Which view is shown.

import { showJobs } from "./jobs.js";
import { showJob } from "./job.js";
import { showMachines } from "./machines.js";
import { element } from "./format.js";

const page = document.getElementById("page");
const status = document.getElementById("link");
let end = () => {};

/** What a view may do beside its own place. */
const shell = {
  /** Says whether the farm answers. */
  link(isUp) { status.textContent = isUp ? "" : "no answer, trying again …"; },
  /** Does something, and tells why where it is not done. */
  async attempt(work) {
    try {
      const result = await work();
      shell.link(true);
      return result;
    } catch (error) {
      if (error.status === undefined) shell.link(false);
      else if (error.status === 401) page.replaceChildren(element("p", {}, "Open the address that bottega printed, with its ?token=…"));
      else status.textContent = error.message;
      return undefined;
    }
  },
};

function route() {
  end();
  const [, view, name] = location.hash.split("/");
  page.replaceChildren();
  if (view === "job") end = showJob(page, shell, Number(name));
  else if (view === "machines") end = showMachines(page, shell);
  else end = showJobs(page, shell);
}

addEventListener("hashchange", route);
route();
