// Scenes in zip archives, and archives that are none.

import assert from "node:assert/strict";
import { test } from "node:test";
import { openedFiles } from "../../assets/scene_files.js";
import { unzipped } from "../../assets/unzip.js";
import { zip } from "../archive.js";

const SCENE = [["room/scene.gltf", "{}".repeat(900)], ["room/", "", true], ["room/a.bin", "bytes", true], ["__MACOSX/._a", "x", true]];

test("the files of an archive are those that were packed", async () => {
  const files = await openedFiles([["room.ZIP", zip(SCENE)], ["sky.hdr", new Blob(["sky"])]]);
  const texts = await Promise.all(files.map(async ([name, blob]) => [name, await blob.text()]));
  assert.deepEqual(texts, [["room/scene.gltf", "{}".repeat(900)], ["room/a.bin", "bytes"], ["sky.hdr", "sky"]]);
});

test("what is no archive, hostile or too much is refused with its reason", async () => {
  const told = (archive, limits) => unzipped(archive, limits).then(() => assert.fail("it was taken"), error => error.message);
  const whole = zip(SCENE);
  for (const end of [0, 21, 100, whole.size - 30]) assert.match(await told(whole.slice(0, end)), /no whole zip archive/);
  assert.match(await told(new Blob(["x".repeat(200_000)])), /no whole zip archive/);
  for (const name of ["../a.bin", "/etc/a.bin", "c:\\a.bin", "a/../../b"]) assert.match(await told(zip([[name, "x"]])), /outside its folder/);
  assert.match(await told(zip(SCENE, () => ({ flags: 1 }))), /encrypted/);
  assert.match(await told(zip(SCENE, () => ({ method: 12 }))), /do not unpack/);
  // A bomb holds more than it says, or says too much.
  assert.match(await told(zip([["a.bin", "0".repeat(5_000_000)]], () => ({ size: 1000 }))), /damaged/);
  assert.match(await told(zip(SCENE, () => ({ size: 1000 }))), /damaged/);
  assert.match(await told(zip(SCENE, () => ({ start: 0xfffffff0 }))), /damaged/);
  assert.match(await told(zip([["a.bin", "0".repeat(5_000_000)]]), { files: 9, bytes: 4e6 }), /more than 4 MB/);
  assert.match(await told(zip(SCENE), { files: 3, bytes: 4e6 }), /holds 4 files/);
});
