// A camera led around in a scene.

import assert from "node:assert/strict";
import { test } from "node:test";
import { viewSize } from "../../assets/lookaround.js";
import { dolly, levelUp, orbit, pan } from "../../assets/orbit.js";

const START = { eye: [0, 0, 5], target: [0, 0, 0], up: [0, 1, 0], fov: 90 };
const near = (a, b) => a.forEach((value, i) => assert.ok(Math.abs(value - b[i]) < 1e-9, `${a} is not ${b}`));

test("a camera goes around what it looks at, and keeps its distance", () => {
  near(orbit(START, -Math.PI / 2, 0).eye, [5, 0, 0]);
  near(orbit(START, 0, Math.PI / 4).eye, [0, 5 * Math.SQRT1_2, 5 * Math.SQRT1_2]);
  const far = orbit(orbit(START, 1, 0.3), -7, -2);
  assert.ok(Math.abs(Math.hypot(...far.eye) - 5) < 1e-9);
  assert.deepEqual([far.target, far.up], [START.target, START.up]);
});

test("no camera looks straight down or turns over", () => {
  const above = orbit(START, 0, 10);
  assert.ok(above.eye[1] > 4.99 && Math.abs(above.eye[2]) > 0.05, `${above.eye}`);
  const below = orbit(START, 0, -10);
  assert.ok(below.eye[1] < -4.99 && below.eye[2] > 0.05, `${below.eye}`);
});

test("what is under the pointer moves with it", () => {
  const moved = pan(START, 0.1, 0);
  // At 90 degrees the picture is ten high at a distance of five.
  near(moved.eye, [-1, 0, 5]);
  near(moved.target, [-1, 0, 0]);
  near(pan(START, 0, 0.1).eye, [0, 1, 5]);
});

test("a camera comes closer by a share of the distance", () => near(dolly(START, 0.5).eye, [0, 0, 2.5]));

test("up is the axis of the scene that is nearest", () => {
  assert.deepEqual(levelUp([0.1, 0.9, -0.4]), [0, 1, 0]);
  assert.deepEqual(levelUp([0, 0.3, -0.9]), [0, 0, -1]);
});

test("a picture is looked at small, in its shape", () => {
  assert.deepEqual(viewSize([1440, 960]), [720, 480]);
  assert.deepEqual(viewSize([100, 50]), [100, 50]);
});
