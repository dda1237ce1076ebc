// Frames of an animation, and how pictures differ, for people.

import assert from "node:assert/strict";
import { test } from "node:test";
import { differenceText } from "../../assets/compare.js";
import { framesOf } from "../../assets/frames.js";
import { named } from "../../assets/submit.js";

const job = (number, frame, animation = "a") => ({ job: number, animation: frame === null ? null : { animation, frame, frames: 3 } });

test("the frames of an animation are its jobs, in their order", () => {
  const jobs = [job(1, 3), job(2, null), job(3, -1), job(4, 1, "b"), job(5, 2)];
  assert.deepEqual(framesOf(jobs, jobs[0]).map(it => it.job), [3, 5, 1]);
  assert.deepEqual(framesOf(jobs, jobs[1]), []);
});

test("the pictures of an animation have a place for the number", () => {
  assert.equal(named({ scene: { file: "walk.glb" }, frames: { list: "1..3" } }).output.file, "walk.####.exr");
});

test("a difference is shown in figures", () => {
  assert.equal(differenceText({ flip: 0.01234, flip_visible_share: 0.5, rel_mse: 0.00012, rmse: 3 }),
    "FLIP 0.0123, seen in 50.0 % of the pixels; relMSE 1.20e-4, RMSE 3.00e+0");
});
