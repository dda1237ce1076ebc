// The agents of a job, and what its auction came to.

import { decimals, element, percent, setText } from "./format.js";
import { VirtualTable } from "./virtual_table.js";

const COLUMNS = [
  {
    name: "agent", head: "Agent", value: agent => agent.agent,
    fill(cell, { agent, hue }) {
      if (!cell.firstChild) cell.append(element("span", { class: "swatch", "aria-hidden": "true" }), element("span"));
      cell.firstChild.style.background = hue === undefined ? "transparent" : `hsl(${hue}, 85%, 60%)`;
      setText(cell.lastChild, agent);
    },
  },
  { name: "done", head: "Done", help: "Zones that it painted", isNumber: true, value: agent => agent.done, text: agent => `${agent.done}` },
  { name: "working", head: "Has", help: "Zones that it paints now", isNumber: true, value: agent => agent.working, text: agent => `${agent.working}` },
  { name: "power", head: "V_cp", help: "Relative computing power: 1 is the reference machine, 0.5 is twice as fast", isNumber: true, value: agent => agent.power, text: agent => decimals(agent.power, 3) },
  { name: "credit", head: "Credit", help: "Promised minus actual time, summed over its zones, in seconds", isNumber: true, value: agent => agent.credit, text: agent => `${decimals(agent.credit, 2)} s` },
  { name: "reliability", head: "Kept", help: "How well it keeps its promises: 100 % if zones took the promised time, 50 % if twice as long", isNumber: true, value: agent => agent.reliability, text: agent => percent(agent.reliability) },
  { name: "lanes", head: "Processors", help: "Processors that work on its zones at once", isNumber: true, value: agent => agent.lanes, text: agent => decimals(agent.lanes, 1) },
  { name: "failures", head: "Failed", help: "How often it has failed since it last painted something", isNumber: true, isNeeded: agent => agent.failures > 0, value: agent => agent.failures, text: agent => `${agent.failures}` },
  { name: "left_out", head: "Left out", help: "Why it is left out of the work", isNeeded: agent => Boolean(agent.left_out), value: agent => agent.left_out, text: agent => agent.left_out ?? "" },
];

export function agentTable() {
  return new VirtualTable({ label: "Agents", columns: COLUMNS, key: agent => agent.agent, rowHeight: 32 });
}

/** The agents with their colors and what they have of the work. */
export function agentRows(agents, hues, work) {
  return agents.map(agent => ({ done: 0, working: 0, ...agent, ...work.get(agent.agent), hue: hues.get(agent.agent) }));
}

/** The auction as a sentence; of a single agent, which has nobody to compete with, nothing. */
export function auctionLine({ rounds, contested, outbid, credit_decided: decided, bids, awards, thefts, stolen }) {
  if (thefts) return `Agents took ${stolen} zones from each other, ${thefts} times.`;
  if (!rounds) return "";
  return `${rounds} rounds, ${contested} with several bidders, ${bids} bids, ${awards} zones given away, ` +
    `${outbid} outbid; credit decided ${decided} rounds.`;
}
