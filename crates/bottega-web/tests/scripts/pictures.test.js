// Where a picture lies, what its zones are colored by, and when it will be done.

import assert from "node:assert/strict";
import { test } from "node:test";
import { fit, keepInside, toPicture, zoomAt } from "../../assets/view_box.js";
import { agentHues, bounds, COLORINGS, summarize, timeText, workOf, zoneAt } from "../../assets/zones.js";

test("a picture fits its window, in the middle", () => {
  assert.deepEqual(fit({ width: 200, height: 100 }, { width: 400, height: 400 }), { scale: 2, x: 0, y: 100 });
  assert.deepEqual(fit({ width: 100, height: 400 }, { width: 400, height: 200 }), { scale: 0.5, x: 175, y: 0 });
});

test("zooming keeps the pixel under the pointer", () => {
  const [view, point] = [{ scale: 1, x: 10, y: 20 }, { x: 110, y: 70 }];
  const before = toPicture(view, point);
  assert.deepEqual(toPicture(zoomAt(view, 4, point, 0.1), point), before);
  assert.equal(zoomAt(view, 1e9, point, 0.1).scale, 64);
  assert.equal(zoomAt(view, 1e-9, point, 0.5).scale, 0.5);
});

test("a part of the picture stays in the window", () => {
  const [picture, window] = [{ width: 100, height: 100 }, { width: 300, height: 300 }];
  assert.deepEqual(keepInside({ scale: 1, x: -5000, y: 5000 }, picture, window), { scale: 1, x: -60, y: 260 });
  assert.deepEqual(keepInside({ scale: 1, x: 30, y: 40 }, picture, window), { scale: 1, x: 30, y: 40 });
});

const zone = (id, rect, more = {}) => ({ id, rect, state: "open", ...more });

test("a pixel belongs to one zone, its right and lower edge to the next", () => {
  const zones = [zone(1, [0, 0, 10, 10]), zone(2, [10, 0, 20, 10])];
  assert.equal(zoneAt(zones, 9.9, 5).id, 1);
  assert.equal(zoneAt(zones, 10, 5).id, 2);
  assert.equal(zoneAt(zones, 20, 5), null);
  assert.deepEqual(bounds(zones), [0, 0, 20, 10]);
  assert.equal(bounds([]), null);
});

test("agents have hues of their own, the same for any order of zones", () => {
  const [one, other] = [agentHues(["b", "a", "c", "a"]), agentHues(["c", "a", "b"])];
  assert.deepEqual([...one], [...other]);
  assert.equal(new Set(one.values()).size, 3);
});

test("colorings tell much from little, and gray where nothing is known", () => {
  const zones = [zone(1, [0, 0, 1, 1], { seconds_estimated: 1, seconds_measured: 2 }), zone(2, [0, 0, 1, 1], { seconds_estimated: 4 })];
  const all = summarize(zones);
  assert.equal(COLORINGS.expected.of(zones[1], all), 0);
  assert.ok(COLORINGS.expected.of(zones[0], all) > 100);
  assert.equal(COLORINGS.measured.of(zones[1], all), null);
  assert.equal(COLORINGS.promise.of(zones[0], all), 0, "twice the promise is red");
  assert.equal(COLORINGS.agent.of(zones[0], all), null);
});

test("work is counted by agent", () => {
  const zones = ["done", "done", "awarded", "open"].map((state, i) => zone(i, [0, 0, 1, 1], { state, agent: i === 3 ? undefined : "a" }));
  assert.deepEqual([...workOf(zones)], [["a", { done: 2, working: 1 }]]);
});

test("the expected time of a zone is not shown as the time that it took", () => {
  assert.equal(timeText({ state: "profiled", seconds_estimated: 8.8 }), "expected 8.8 s");
  assert.equal(timeText({ seconds_estimated: 8.8, seconds_measured: 8.1 }), "took 8.1 s, expected 8.8 s");
  assert.equal(timeText({ seconds_measured: 8.1 }), "took 8.1 s");
  assert.equal(timeText({}), "");
});

test("each coloring says what its colors mean, in the colors of the zones", () => {
  const zones = [zone(1, [0, 0, 1, 1], { agent: "a", seconds_estimated: 4, seconds_measured: 8, state: "done" })];
  const all = summarize(zones);
  for (const { of, legend } of Object.values(COLORINGS)) assert.ok(legend(all).some(([hue]) => hue === of(zones[0], all)));
  assert.deepEqual(COLORINGS.agent.legend(all).map(([, text]) => text), ["a"]);
  assert.equal(COLORINGS.measured.legend(all).at(-1)[1], "8.0 s");
  assert.deepEqual(COLORINGS.expected.legend(summarize([])), [], "nothing is known");
});
