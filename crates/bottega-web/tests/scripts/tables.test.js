// Rows of tables: which are seen, and in which order; which jobs are looked for.

import assert from "node:assert/strict";
import { test } from "node:test";
import { agentRows, auctionLine } from "../../assets/agents.js";
import { endedJobs, endText } from "../../assets/bell.js";
import { energyFacts, usedText } from "../../assets/energy.js";
import { zoneFields } from "../../assets/blackboard.js";
import { time } from "../../assets/format.js";
import { isWanted } from "../../assets/jobs.js";
import { powerOf, stateOf } from "../../assets/machines.js";
import { points } from "../../assets/sparkline.js";
import { sorted, visibleRange } from "../../assets/virtual_table.js";

test("of ten thousand rows those are made that are seen, and a few more", () => {
  assert.deepEqual(visibleRange(0, 320, 32, 10_000, 6), [0, 16]);
  assert.deepEqual(visibleRange(32_000, 320, 32, 10_000, 6), [994, 1016]);
  assert.deepEqual(visibleRange(1e9, 320, 32, 10_000, 6), [9994, 10_000]);
  assert.deepEqual(visibleRange(0, 320, 32, 0, 6), [0, 0]);
});

test("times have units in which some digits are seen", () => {
  assert.deepEqual([undefined, 0, 0.0004, 0.031, 0.2, 12.4, 300, 7200].map(time), ["–", "0 s", "1 ms", "31 ms", "0.2 s", "12 s", "5.0 min", "2.0 h"]);
});

test("rows without a value come last in both directions", () => {
  const rows = [{ id: 1, value: 3 }, { id: 2 }, { id: 3, value: 1 }, { id: 4, value: 3 }];
  const ids = isDescending => sorted(rows, row => row.value, row => row.id, isDescending).map(row => row.id);
  assert.deepEqual(ids(false), [3, 1, 4, 2]);
  assert.deepEqual(ids(true), [1, 4, 3, 2]);
});

test("jobs are found by words of any of their names", () => {
  const job = { job: 12, scene: "goblets.glb", output: "night.exr", from: "web-anna", leader: null, state: "active" };
  assert.ok(isWanted(job, "", ""));
  assert.ok(isWanted(job, "GOB anna", "active"));
  assert.ok(!isWanted(job, "gob berta", ""));
  assert.ok(!isWanted(job, "gob", "done"));
});

test("the speeds of a machine's agents add up", () => {
  assert.equal(powerOf({ agents: [{ power: 1 }, { power: 1 }] }), 0.5);
  assert.equal(powerOf({ agents: [] }), null);
});

test("a command to a machine is shown until it is obeyed", () => {
  assert.equal(stateOf({ state: "active", ordered: "suspended", job: 1 }), "active, to be suspended");
  assert.equal(stateOf({ state: "suspended", ordered: "suspended", job: null }), "suspended");
  assert.equal(stateOf({ state: "active", ordered: "active", job: null }), "idle");
});

test("a line goes from the left to the right, high values up", () => {
  assert.equal(points([1]), "");
  assert.equal(points([0, 1]), "0.0,19.0 80.0,1.0");
  assert.equal(points([5, 5]), "0.0,10.0 80.0,10.0");
});

test("a zone tells what it is painted with, and whose rules decided", () => {
  const zone = {
    id: 1, work: 7, rect: [0, 0, 8, 8], size: 64, complexity: 2, state: "done", attempt: 0, samples: 16,
    choice: { max_depth: 4, light_samples: 1, samples: 16, bands: [0, 1, 2, 3] }, reasons: "path_tracing: 12 0.83",
  };
  const fields = new Map(zoneFields(zone).map(([name, value]) => [name, value]));
  assert.equal(fields.get("Rules"), "path_tracing: 12 0.83");
  assert.equal(fields.get("Bands"), "0, 1, 2, 3");
  assert.ok(!fields.has("Error") && !fields.has("Agent"), "what is not known is not shown");
});

test("agents are shown with their work and their color", () => {
  const rows = agentRows([{ agent: "a" }, { agent: "b" }], new Map([["a", 30]]), new Map([["a", { done: 2, working: 1 }]]));
  assert.deepEqual(rows, [{ done: 2, working: 1, agent: "a", hue: 30 }, { done: 0, working: 0, agent: "b", hue: undefined }]);
  assert.match(auctionLine({ rounds: 3, contested: 2, outbid: 1, credit_decided: 1, bids: 9, awards: 4 }), /3 rounds, 2 with several bidders/);
  assert.match(auctionLine({ rounds: 0, thefts: 2, stolen: 5 }), /took 5 zones from each other, 2 times/);
  assert.equal(auctionLine({ rounds: 0, thefts: 0 }), "", "a single agent competes with nobody");
});

test("the bell rings once for each job that ends, and not for those that were over", () => {
  const job = (number, state) => ({ job: number, state, scene: "s.glb", output: "p.exr" });
  const [none, first] = endedJobs(null, [job(1, "done"), job(2, "active")]);
  assert.deepEqual(none, []);
  const [ended, second] = endedJobs(first, [job(1, "done"), job(2, "failed"), job(3, "done"), job(4, "cancelled")]);
  assert.deepEqual(ended.map(it => it.job), [2, 3], "one that came and ended between two looks, too");
  assert.deepEqual(endedJobs(second, [job(2, "failed"), job(3, "done")])[0], []);
  assert.deepEqual(endText({ ...job(2, "failed"), reason: "no scene" }), ["Job 2: failed", "no scene"]);
  assert.deepEqual(endText(job(3, "done")), ["Job 3: done", "s.glb → p.exr"]);
});

test("known energy is shown", () => {
  assert.deepEqual(energyFacts(null), []);
  assert.deepEqual(energyFacts({ processor_seconds: 3, is_partial: true }).map(([name, text]) => [name, text]), [["Processor time", "3.0 s"]]);
  const energy = { processor_seconds: 3, kwh: 0.25, cost: 0.125, currency: "EUR", is_partial: false };
  assert.equal(energyFacts(energy)[1][1], "0.250 kWh, 0.125 EUR");
  assert.equal(energyFacts({ ...energy, is_partial: true })[1][1], "at least 0.250 kWh, 0.125 EUR");
  assert.equal(usedText({ kwh: 0.0005 }), "0.500 Wh");
  assert.equal(usedText({}), undefined);
});
