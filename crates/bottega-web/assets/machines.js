// The machines that are there, and what can be done to them.

import { ask, get } from "./api.js";
import { element, table } from "./format.js";

const LOOK_EVERY = 1000;

export function showMachines(page, shell) {
  const place = element("div");
  page.replaceChildren(element("h1", {}, "Machines"), place);
  const look = async () => {
    const machines = await shell.attempt(() => get("/machines"));
    if (!machines || place.querySelector("button:active")) return;
    const button = (machine, word, order) => element("button", {
      type: "button",
      onclick: async () => { await shell.attempt(() => ask("POST", `/machines/${encodeURIComponent(machine.name)}/${order}`)); look(); },
    }, word);
    const orders = machine => !machine.takes_orders ? [] : [
      machine.ordered === "suspended" ? button(machine, "Resume", "resume") : button(machine, "Suspend", "suspend"),
      button(machine, "Terminate", "terminate"),
    ];
    const row = machine => [
      machine.name, machine.state, `${machine.threads}`,
      machine.job === null ? "–" : element("a", { href: `#/job/${machine.job}` }, `${machine.job}`),
      machine.agents.map(agent => `${agent.power.toFixed(3)} / ${agent.credit.toFixed(2)} s`).join(", ") || "–",
      machine.reliability === null ? "–" : machine.reliability.toFixed(2), element("span", {}, orders(machine)),
    ];
    place.replaceChildren(machines.length
      ? table(["Machine", "State", "Processors", "Job", "V_cp / credit", "Promises held", ""], machines.map(row))
      : element("p", {}, "No machines yet: bottega join, with the line that bottega up printed"));
  };
  look();
  const timer = setInterval(look, LOOK_EVERY);
  return () => clearInterval(timer);
}
