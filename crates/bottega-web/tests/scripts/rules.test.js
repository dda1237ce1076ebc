// Rules: terms as drawings, values as sentences.

import assert from "node:assert/strict";
import { test } from "node:test";
import { inputText, outline, placeX, short } from "../../assets/rules.js";

test("a term is drawn from edge to edge, level outside of its points", () => {
  assert.deepEqual(outline({ points: [[2, 1], [4, 0]] }, [0, 10]), [[0, 1], [2, 1], [4, 0], [10, 0]]);
  assert.deepEqual(outline({ points: [[0, 0], [10, 1]] }, [0, 10]), [[0, 0], [10, 1]]);
  assert.deepEqual(outline({ points: [[3, 1]] }, [0, 10]), [[3, 0], [3, 1], [3, 0]], "a single value is a line");
});

test("values stand where they are in the range, and at its edge where they are outside", () => {
  assert.equal(placeX(5, [0, 10], 280), 140);
  assert.equal(placeX(-5, [0, 10], 280), placeX(0, [0, 10], 280));
  assert.equal(placeX(3, [3, 3], 280), 140, "a range without width");
});

test("an input is shown with its terms, the strongest first", () => {
  const input = { name: "neighbor_difference", value: 0.123456, terms: [["small", 0.25], ["big", 0.75]] };
  assert.equal(inputText(input), "neighbor difference is 0.123: big 0.75, small 0.25");
  assert.equal(inputText({ name: "size", value: 64, terms: [] }), "size is 64: no term holds");
  assert.equal(short(123456.7), "123000");
});
