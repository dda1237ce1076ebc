// The form of a request, read from a schema, and the files of a scene.

import assert from "node:assert/strict";
import { test } from "node:test";
import { lightOf, scenesOf } from "../../assets/scene_files.js";
import { fieldNamed, formOf, requestOf, requestWithout, valueAt } from "../../assets/schema_form.js";
import { hint, parsed, WrongValue } from "../../assets/schema_widgets.js";
import { viewOptions } from "../../assets/lookaround.js";
import { named } from "../../assets/submit.js";
import { persist } from "../../assets/upload.js";

const SCHEMA = {
  properties: {
    film: { $ref: "#/$defs/Film", default: {} },
    guide: { $ref: "#/$defs/Guide" },
    seed: { type: "integer", default: 0, minimum: 0, description: "The seed." },
    devices: { $ref: "#/$defs/Film" },
    version: { type: "integer" },
  },
  $defs: {
    Film: {
      type: "object", description: "The film.",
      properties: {
        size: { type: ["array", "null"], items: { type: "integer" }, minItems: 2, maxItems: 2, default: null },
        layers: { type: ["array", "null"], items: { type: "string" } },
        filter: { anyOf: [{ $ref: "#/$defs/Filter" }, { type: "null" }], description: "Spread.", default: null },
        light: { oneOf: [{ const: "sky" }, { type: "object", properties: { file: { type: "string" } } }] },
      },
    },
    Filter: { description: "Not this.", oneOf: [{ const: "box", description: "Just the pixel." }, { const: "tent" }] },
    Guide: { type: "object", properties: { uses: { type: "array", items: { $ref: "#/$defs/Filter" }, default: [] }, rules: { type: "object" } } },
  },
};

test("a form has the main fields first and the rest by section", () => {
  const { main, sections } = formOf(SCHEMA);
  assert.deepEqual(main.map(field => [field.path, field.kind]), [["film.size", "tuple"]]);
  const rest = sections.flatMap(section => section.fields.map(field => [field.path, field.kind]));
  assert.deepEqual(rest, [["film.layers", "list"], ["film.filter", "choice"], ["film.light", "variant"],
    ["guide.uses", "set"], ["guide.rules", "json"], ["seed", "number"]]);
  const filter = sections[0].fields[1];
  assert.equal(filter.description, "Spread.");
  assert.equal(filter.isNullable, true);
  assert.equal(filter.variants[0].description, "Just the pixel.");
});

test("what people write becomes values, and nothing stays the default", () => {
  const size = { kind: "tuple", count: 2, isInteger: true };
  assert.deepEqual(parsed("640 x 480", size), [640, 480]);
  assert.deepEqual(parsed("640×480", size), [640, 480]);
  assert.equal(parsed("  ", size), undefined);
  assert.throws(() => parsed("640", size), WrongValue);
  assert.throws(() => parsed("1.5", { kind: "number", isInteger: true }), WrongValue);
  assert.throws(() => parsed("abc", { kind: "number" }), WrongValue);
  assert.equal(parsed("0.5", { kind: "number" }), 0.5);
  assert.deepEqual(parsed("albedo, normal", { kind: "list" }), ["albedo", "normal"]);
  assert.throws(() => parsed("{", { kind: "json" }), WrongValue);
});

test("a hint is the default", () => {
  assert.equal(hint({ kind: "number", default: 64 }), "64");
  assert.equal(hint({ kind: "number", default: null }), "automatic");
  assert.equal(hint({ kind: "list", default: [] }), "none");
});

test("only what was said is in a request", () => {
  const values = [["scene.file", "a.glb"], ["film.size", undefined], ["goal.samples", 4], ["seed", 0]];
  assert.deepEqual(requestOf(values), { scene: { file: "a.glb" }, goal: { samples: 4 }, seed: 0 });
});

test("a picture is called as its scene where it has no name", () => {
  assert.equal(named({ scene: { file: "room/tea.set.gltf" } }).output.file, "tea.set.exr");
  assert.equal(named({ scene: { file: "a.glb" }, output: { file: "b.png" } }).output.file, "b.png");
  assert.deepEqual(named({}), {});
});

test("an answer that names a field is shown at that field", () => {
  const paths = ["goal.samples", "environment.light", "seed"];
  assert.equal(fieldNamed("`goal.samples` is 0: from 1 to 4194304 is allowed", paths), "goal.samples");
  assert.equal(fieldNamed("`environment.light.file` is `x`", paths), "environment.light");
  assert.equal(fieldNamed("the scene `seedling.glb` cannot be read", paths), null);
});

test("the scene is found among its files", () => {
  const names = ["room/tex/wood.exr", "room/parts/chair.obj", "room/room.gltf", "room/old/room.gltf", "room/room.bin"];
  assert.deepEqual(scenesOf(names), ["room/room.gltf", "room/old/room.gltf", "room/parts/chair.obj"]);
  assert.equal(lightOf(["a.glb", "sky.hdr"], "a.glb"), "sky.hdr");
  assert.equal(lightOf(["a.xml", "sky.exr"], "a.xml"), null, "such a scene says itself what the file is");
  assert.equal(lightOf(["a.glb", "sky.hdr", "sun.hdr"], "a.glb"), null, "either may be meant");
});

test("a request that the farm cannot answer now is repeated, a wrong one is not", async () => {
  let calls = 0;
  const waits = [];
  const failing = status => async () => {
    calls++;
    if (calls < 3) throw Object.assign(new Error("no"), { status });
    return "done";
  };
  assert.equal(await persist(failing(503), async seconds => waits.push(seconds)), "done");
  assert.deepEqual(waits, [1, 2]);
  calls = 0;
  await assert.rejects(persist(failing(422), async () => {}), /no/);
  assert.equal(calls, 1);
});

test("a request that is submitted again keeps what the form does not show", () => {
  const request = { version: 1, scene: { file: "a.glb", strict: true }, goal: { samples: 4 }, devices: { exact: true }, seed: 3 };
  const others = requestWithout(request, ["version", "scene.file", "goal.samples", "seed", "film.size"]);
  assert.deepEqual(others, { scene: { strict: true }, devices: { exact: true } });
  const shown = ["goal.samples", "film.size", "seed"].map(path => [path, valueAt(request, path)]);
  assert.deepEqual(requestOf([["scene.file", "a.glb"], ...shown], others),
    { scene: { file: "a.glb", strict: true }, goal: { samples: 4 }, devices: { exact: true }, seed: 3 });
  assert.equal(request.goal.samples, 4, "the request itself stays");
});

test("a view is written as options of the command line", () => {
  const pose = { eye: [0.123456, 1, 3], target: [0, 1, 0], up: [0, 1, 0], fov: null };
  assert.equal(viewOptions({ camera: 0, pose }), `--set 'view.pose={"eye":[0.1235,1,3],"target":[0,1,0],"up":[0,1,0]}'`);
  assert.match(viewOptions({ camera: 2, pose: { ...pose, fov: 40 } }), /^--camera 2 --set .*"fov":40\}'$/);
});
