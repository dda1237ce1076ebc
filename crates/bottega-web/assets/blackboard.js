// The Blackboard of a job: its zones row by row, and all that is known of one of them.

import { decimals, element, time } from "./format.js";
import { stateWord, STATES } from "./zones.js";
import { VirtualTable } from "./virtual_table.js";

const times = [
  ["seconds_estimated", "Expected", "T_est: seconds of the reference machine that the zone should take"],
  ["seconds_measured", "Measured", "T_real: seconds of the reference machine that it took"],
];

const COLUMNS = [
  { name: "id", head: "Zone", help: "IdZone", isNumber: true, value: zone => zone.id, text: zone => `${zone.id}` },
  { name: "state", head: "State", value: zone => stateWord(zone.state), text: zone => stateWord(zone.state) },
  { name: "agent", head: "Agent", help: "The agent that has or had it", value: zone => zone.agent, text: zone => zone.agent ?? "–" },
  ...times.map(([name, head, help]) => ({ name, head, help, isNumber: true, value: zone => zone[name], text: zone => time(zone[name]) })),
  {
    name: "complexity", head: "Cost", help: "Complexity: the predicted cost of all its pixels, in average pixels of the picture",
    isNumber: true, value: zone => zone.complexity, text: zone => decimals(zone.complexity, 0),
  },
  { name: "size", head: "Pixels", isNumber: true, value: zone => zone.size, text: zone => `${zone.size}` },
  { name: "samples", head: "Samples", help: "Samples that each pixel has", isNumber: true, value: zone => zone.samples, text: zone => `${zone.samples}` },
  { name: "error", head: "Error", help: "Estimated relative error, if one was requested", isNumber: true, isNeeded: zone => zone.error !== undefined, value: zone => zone.error, text: zone => decimals(zone.error, 4) },
  { name: "attempt", head: "Lost", help: "How often it was taken from an agent that failed or fell silent", isNumber: true, isNeeded: zone => zone.attempt > 0, value: zone => zone.attempt, text: zone => `${zone.attempt}` },
];

export function blackboard(onSelect) {
  return new VirtualTable({ label: "Blackboard", columns: COLUMNS, key: zone => zone.id, onSelect, rowHeight: 32 });
}

/** All fields of a zone, with what they mean. `used`: its energy as a text, where it is known. */
export function zoneFields(zone, used) {
  const [x0, y0, x1, y1] = zone.rect;
  const { choice } = zone;
  return [
    ["State", stateWord(zone.state), STATES[zone.state]?.[1]],
    ["Agent", zone.agent, "The agent that has or had it"],
    ["Place", `${x0}, ${y0} to ${x1}, ${y1}`, "Left, top, right and bottom, in pixels"],
    ["Pixels", `${zone.size}`, "Its size"],
    ["Expected time", time(zone.seconds_estimated), times[0][2]],
    ["Measured time", time(zone.seconds_measured), times[1][2]],
    ["Energy", used, "Its share of the energy of the machine that painted it, by measured time"],
    ["Cost", decimals(zone.complexity, 1), "Complexity: the predicted cost of all its pixels, in average pixels of the picture"],
    ["Samples", `${zone.samples}`, "Samples that each pixel has"],
    ["Error", zone.error === undefined ? undefined : zone.error.toFixed(4), "Estimated relative error"],
    ["Lost by agents", `${zone.attempt}`, "How often it was taken from an agent that failed or fell silent"],
    ["Bounces of light", choice && `${choice.max_depth}`, "The recursion level that was chosen for it"],
    ["Light samples", choice && `${choice.light_samples}`, "At each bounce"],
    ["Samples chosen", choice && `${choice.samples}`, "Samples per pixel that were chosen for it"],
    ["Bands", choice && choice.bands.join(", "), "Interpolation bands beyond its left, top, right and bottom edge, in pixels"],
    ["Rules", zone.reasons, "The agent whose rules chose its settings, the rules, and their strength"],
    ["Work", `${zone.work}`, "IdWork"],
  ].filter(([, value]) => value !== undefined);
}

/** The panel of a zone; null: none is chosen. */
export function zonePanel(zone, used) {
  if (!zone) {
    return [element("h2", {}, "Zone"), element("p", { class: "quiet" }, "Click a zone in the picture, or a row of the Blackboard.")];
  }
  const fields = zoneFields(zone, used).map(([name, value, help]) => [element("dt", { title: help }, name), element("dd", {}, value)]);
  const rules = zone.reasons === undefined
    ? element("p", { class: "quiet" }, "No rules decided here: it is painted with the requested settings.") : null;
  return [element("h2", {}, `Zone ${zone.id}`), element("dl", {}, fields), rules];
}
