// The machines that are there, and what can be done to them.

import { ask, get } from "./api.js";
import { sourceText, usedText } from "./energy.js";
import { button, counted, decimals, element, percent, setText } from "./format.js";
import { History, sparkline } from "./sparkline.js";
import { VirtualTable } from "./virtual_table.js";

const LOOK_EVERY = 1000;
const HISTORY_MAX = 300;
/** V_cp and credit of each machine, since the page was opened. */
const histories = new Map();

const sum = (agents, key) => (agents.length ? agents.reduce((total, agent) => total + agent[key], 0) : null);
/** V_cp of all agents of a machine together: speeds add up, and V_cp is time. */
export const powerOf = ({ agents }) => (agents.length ? 1 / agents.reduce((speed, agent) => speed + 1 / agent.power, 0) : null);
const creditOf = ({ agents }) => sum(agents, "credit");

/** The energy of a machine alone: its cost has no currency here. */
const usedOf = energy => (energy ? usedText({ kwh: energy.kwh }) : undefined);

function remember(machines) {
  const names = new Set(machines.map(machine => machine.name));
  for (const name of histories.keys()) if (!names.has(name)) histories.delete(name);
  for (const machine of machines) {
    if (!histories.has(machine.name)) histories.set(machine.name, { power: new History(HISTORY_MAX), credit: new History(HISTORY_MAX) });
    const [power, credit] = [powerOf(machine), creditOf(machine)];
    if (power !== null) histories.get(machine.name).power.take(power);
    if (credit !== null) histories.get(machine.name).credit.take(credit);
  }
}

function fillLine(key, text) {
  return (cell, machine) => {
    if (!cell.firstChild) cell.append(element("span"), sparkline());
    setText(cell.firstChild, text(machine));
    cell.lastChild.set(histories.get(machine.name)?.[key].values ?? []);
  };
}

/** The state of a machine, in a word; a command may not have been obeyed yet. */
export function stateOf({ state, ordered, job }) {
  if (ordered !== state && ordered !== "active") return `${state}, to be ${ordered}`;
  if (state !== "active") return state;
  return job === null ? "idle" : "painting";
}

function columns(shell, look) {
  const order = async (cell, name, word) => {
    const isSure = word !== "terminate" || await shell.confirm(`Have ${name} leave the farm? It can only be brought back from that machine.`, "Terminate");
    if (isSure) await shell.attempt(() => ask("POST", `/machines/${encodeURIComponent(name)}/${word}`), cell);
    look();
  };
  return [
    {
      name: "name", head: "Machine", value: machine => machine.name,
      fill(cell, { name, is_guest: isGuest }) {
        setText(cell, `${name}${isGuest ? " (guest)" : ""}`);
        cell.title = cell.textContent;
      },
    },
    {
      name: "state", head: "State", value: machine => `${stateOf(machine)} ${machine.job ?? ""}`,
      fill(cell, machine) {
        const [state, job] = [stateOf(machine), machine.job];
        const key = `${state} ${job}`;
        if (cell.dataset.key === key) return;
        cell.dataset.key = key;
        cell.replaceChildren(state, ...(job === null ? [] : [" ", element("a", { href: `#/job/${job}` }, `job ${job}`)]));
      },
    },
    { name: "threads", head: "CPUs", help: "Processors that paint", isNumber: true, value: machine => machine.threads, text: machine => `${machine.threads}` },
    {
      name: "devices", head: "Devices", help: "Its GPUs and boards, if a job allows them", value: machine => machine.devices.length,
      isNeeded: machine => machine.devices.length > 0,
      fill(cell, { devices }) {
        setText(cell, devices.join(", ") || "–");
        cell.title = cell.textContent;
      },
    },
    {
      name: "tags", head: "Tags", help: "Tags of the machine (join --tag), which a job may require (farm.require)",
      isNeeded: machine => machine.tags.length > 0, value: machine => machine.tags.join(" "), text: machine => machine.tags.join(" ") || "–",
    },
    {
      name: "power", head: "V_cp", help: "Relative computing power in the job that it paints: 1 is the reference machine, 0.5 is twice as fast. The line is since this page was opened",
      value: powerOf, fill: fillLine("power", machine => decimals(powerOf(machine), 3)),
    },
    {
      name: "credit", head: "Credit", help: "Promised minus actual time of its agents, in seconds. The line is since this page was opened",
      value: creditOf, fill: fillLine("credit", machine => (creditOf(machine) === null ? "–" : `${creditOf(machine).toFixed(1)} s`)),
    },
    {
      name: "reliability", head: "Kept", help: "How well it kept its promises in the jobs so far: 100 % if zones took the promised time",
      isNumber: true, value: machine => machine.reliability, text: machine => (machine.reliability === null ? "–" : percent(machine.reliability)),
    },
    {
      name: "energy", head: "Energy", help: "Time and energy that it has used for its job", isNumber: true, value: ({ energy }) => energy?.kwh,
      isNeeded: ({ energy }) => usedOf(energy) !== undefined,
      fill(cell, { energy }) {
        setText(cell, usedOf(energy) ?? "–");
        cell.title = energy ? sourceText(energy) : "";
      },
    },
    {
      name: "refusals", head: "Refused", help: "Jobs that it cannot paint", value: machine => machine.refusals.length,
      isNeeded: machine => machine.refusals.length > 0,
      fill(cell, { refusals }) {
        setText(cell, refusals.map(({ job, reason }) => `job ${job}: ${reason}`).join("; "));
        cell.title = cell.textContent;
      },
    },
    {
      name: "orders", head: "Orders", className: "orders steers", value: machine => Number(machine.takes_orders),
      fill(cell, { name, ordered, takes_orders: takesOrders }) {
        const key = `${takesOrders} ${ordered}`;
        if (cell.dataset.key === key) return;
        cell.dataset.key = key;
        const make = (word, what) => button(word, () => order(cell, name, what), { ariaLabel: `${word} ${name}` });
        cell.replaceChildren(...(!takesOrders || ordered === "terminated" ? [] : [
          ordered === "suspended" ? make("Resume", "resume") : make("Suspend", "suspend"),
          make("Terminate", "terminate"),
        ]));
      },
    },
  ];
}

export function showMachines(page, shell) {
  const count = element("p", { class: "quiet", role: "status" });
  const text = element("input", { type: "search", placeholder: "Name or state …", ariaLabel: "Filter machines", oninput: () => show() });
  let machines = [];
  const table = new VirtualTable({ label: "Machines", columns: columns(shell, () => look()), key: machine => machine.name, rowHeight: 44 });
  table.element.classList.add("tall");
  page.replaceChildren(element("h1", {}, "Machines"), element("div", { class: "row filter" }, text, count), table.element);

  function show() {
    const wanted = machines.filter(machine => `${machine.name} ${stateOf(machine)}`.toLowerCase().includes(text.value.toLowerCase()));
    const threads = machines.reduce((all, machine) => all + machine.threads, 0);
    const some = wanted.length === machines.length ? "" : `${wanted.length} of `;
    setText(count, machines.length ? `${some}${counted(machines.length, "machine")}, ${counted(threads, "processor")}`
      : "No machines yet: run bottega join on each, with the line that bottega up printed.");
    table.set(wanted);
  }

  async function look() {
    const found = await shell.poll(() => get("/machines"));
    if (!found) return;
    machines = found;
    remember(machines);
    show();
  }
  look();
  const timer = setInterval(look, LOOK_EVERY);
  return () => {
    clearInterval(timer);
    table.close();
  };
}
