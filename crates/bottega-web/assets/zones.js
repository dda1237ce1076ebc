// Zones of a picture: what lies where, and in which color.

import { time } from "./format.js";

/** States in which an agent works on a zone. */
const WORKING = new Set(["profiling", "awarded"]);

export const isWorking = zone => WORKING.has(zone.state);

/** What people read for a state, and what it means. */
export const STATES = {
  open: ["open", "nobody has it yet"],
  profiling: ["being estimated", "an agent paints a few samples to see how long the zone takes"],
  profiled: ["estimated", "its time is expected from a few samples; agents may bid for it"],
  awarded: ["being painted", "an agent won it in the auction and paints it"],
  done: ["done", "painted"],
  failed: ["failed", "nobody could paint it"],
};

export const stateWord = state => STATES[state]?.[0] ?? state;

/** What is known of the time of a zone: which it took, or else which is expected. */
export function timeText({ seconds_estimated: expected, seconds_measured: measured }) {
  const ofIt = expected === undefined || expected === null ? "" : `expected ${time(expected)}`;
  if (measured === undefined || measured === null) return ofIt;
  return `took ${time(measured)}${ofIt && `, ${ofIt}`}`;
}

/** The rectangle around all zones: x0, y0, x1, y1; none: null. */
export function bounds(zones) {
  let all = null;
  for (const { rect } of zones) {
    if (!all) all = [...rect];
    for (const i of [0, 1]) all[i] = Math.min(all[i], rect[i]);
    for (const i of [2, 3]) all[i] = Math.max(all[i], rect[i]);
  }
  return all;
}

/** The zone at a pixel. */
export function zoneAt(zones, x, y) {
  for (const zone of zones) {
    const [x0, y0, x1, y1] = zone.rect;
    if (x >= x0 && x < x1 && y >= y0 && y < y1) return zone;
  }
  return null;
}

/** The hue of each agent, 0 to 360: by golden angles in the order of their names, so that neighbors differ. */
export function agentHues(names) {
  return new Map([...new Set(names)].sort().map((name, i) => [name, Math.round((205 + i * 137.508) % 360)]));
}

const STATE_HUES = { open: 220, profiling: 45, profiled: 60, awarded: 30, done: 140, failed: 0 };

/** From blue (little) through yellow to red (much). */
const heat = share => Math.round(230 - 230 * Math.min(1, Math.max(0, share)));

/**
 * What zones are colored by: `of` is the hue of a zone, or null for gray; `legend` what the colors mean, as pairs of a hue and a text.
 * `isScale`: colors between them lie between their meanings.
 */
export const COLORINGS = {
  agent: {
    name: "Agent", of: (zone, all) => all.hues.get(zone.agent) ?? null,
    legend: all => [...all.hues].map(([agent, hue]) => [hue, agent]),
  },
  state: {
    name: "State", of: zone => STATE_HUES[zone.state] ?? null,
    legend: () => Object.entries(STATE_HUES).map(([state, hue]) => [hue, stateWord(state)]),
  },
  expected: {
    name: "Expected time", isScale: true, of: (zone, all) => heatOf(zone.seconds_estimated, all.expectedMax),
    legend: all => timeScale(all.expectedMax),
  },
  measured: {
    name: "Measured time", isScale: true, of: (zone, all) => heatOf(zone.seconds_measured, all.measuredMax),
    legend: all => timeScale(all.measuredMax),
  },
  promise: {
    name: "Measured ÷ expected", isScale: true, of: zone => promiseHue(zone),
    legend: () => [[heat(0), "half as long as expected"], [heat(0.5), "as expected"], [heat(1), "twice as long"]],
  },
};

const timeScale = max => (max ? [[heat(0), time(0)], [heat(0.5), time(max / 2)], [heat(1), time(max)]] : []);

const heatOf = (value, max) => (value === undefined || !max ? null : heat(value / max));

/** Blue: half the expected time; yellow-green: as expected; red: twice the expected time. */
function promiseHue({ seconds_estimated: expected, seconds_measured: measured }) {
  return expected && measured ? heat((Math.log2(measured / expected) + 1) / 2) : null;
}

/** What colorings need to know of all zones together. */
export function summarize(zones) {
  const most = key => zones.reduce((max, zone) => Math.max(max, zone[key] ?? 0), 0);
  return {
    hues: agentHues(zones.map(zone => zone.agent).filter(Boolean)),
    expectedMax: most("seconds_estimated"),
    measuredMax: most("seconds_measured"),
  };
}

/** Who paints how much: by agent, zones done and under way. */
export function workOf(zones) {
  const work = new Map();
  for (const zone of zones) {
    if (!zone.agent) continue;
    if (!work.has(zone.agent)) work.set(zone.agent, { done: 0, working: 0 });
    const of = work.get(zone.agent);
    if (zone.state === "done") of.done++;
    else if (isWorking(zone)) of.working++;
  }
  return work;
}
