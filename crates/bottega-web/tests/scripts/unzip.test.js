// Scenes in zip archives, and invalid archives.

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

test("invalid, hostile and too large archives are refused with the reason", async () => {
  const problemOf = (archive, limits) => unzipped(archive, limits).then(() => assert.fail("it was taken"), error => error.message);
  const whole = zip(SCENE);
  for (const end of [0, 21, 100, whole.size - 30]) assert.match(await problemOf(whole.slice(0, end)), /not a complete zip archive/);
  assert.match(await problemOf(new Blob(["x".repeat(200_000)])), /not a complete zip archive/);
  for (const name of ["../a.bin", "/etc/a.bin", "c:\\a.bin", "a/../../b"]) assert.match(await problemOf(zip([[name, "x"]])), /outside its folder/);
  assert.match(await problemOf(zip(SCENE, () => ({ flags: 1 }))), /encrypted/);
  assert.match(await problemOf(zip(SCENE, () => ({ method: 12 }))), /do not unpack/);
  // A bomb holds more than it says, or says too much.
  assert.match(await problemOf(zip([["a.bin", "0".repeat(5_000_000)]], () => ({ size: 1000 }))), /damaged/);
  assert.match(await problemOf(zip(SCENE, () => ({ size: 1000 }))), /damaged/);
  assert.match(await problemOf(zip(SCENE, () => ({ start: 0xfffffff0 }))), /damaged/);
  assert.match(await problemOf(zip([["a.bin", "0".repeat(5_000_000)]]), { files: 9, bytes: 4e6 }), /more than 4 MB/);
  assert.match(await problemOf(zip(SCENE), { files: 3, bytes: 4e6 }), /holds 4 files/);
});
