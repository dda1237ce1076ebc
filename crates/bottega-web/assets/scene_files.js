// The files of a scene that somebody drops or chooses.

import { unzipped } from "./unzip.js";

/** What is taken for a scene, the likeliest first. */
const SCENE_KINDS = [
  ".glb", ".gltf", ".usdz", ".usd", ".usda", ".usdc", ".xml", ".pbrt", ".blend", ".obj", ".ply", ".pov", ".vdb", ".nvdb",
];
/** Scenes that have no light from all around in their files. */
const BARE_KINDS = [".glb", ".gltf", ".usdz", ".obj", ".ply"];
const LIGHT_KINDS = [".hdr", ".exr"];

const kindOf = name => /\.[^./]+$/.exec(name.toLowerCase())?.[0] ?? "";

/** Names of those that may be the scene, the likeliest first: by kind, then those that lie highest. */
export function scenesOf(names) {
  const rank = name => [SCENE_KINDS.indexOf(kindOf(name)), name.split("/").length];
  return names.filter(name => SCENE_KINDS.includes(kindOf(name))).sort((a, b) => {
    const [[kindA, depthA], [kindB, depthB]] = [rank(a), rank(b)];
    return kindA - kindB || depthA - depthB || (a < b ? -1 : 1);
  });
}

/** The picture that is light from all around: the only one beside a scene whose own files cannot be of this kind. Or null. */
export function lightOf(names, scene) {
  const lights = names.filter(name => LIGHT_KINDS.includes(kindOf(name)));
  return BARE_KINDS.includes(kindOf(scene ?? "")) && lights.length === 1 ? lights[0] : null;
}

/** Files with their names, out of an `<input type=file>`. */
export const chosenFiles = list => [...list].map(file => [file.webkitRelativePath || file.name, file]);

/** Files with their names, out of what was dropped: folders with all that is in them. */
export async function droppedFiles(transfer) {
  // All entries are taken before the first wait: the transfer is empty afterwards.
  const entries = [...transfer.items].map(item => item.webkitGetAsEntry?.()).filter(Boolean);
  if (!entries.length) return chosenFiles(transfer.files);
  const found = [];
  for (const entry of entries) await walk(entry, found);
  return found;
}

/** The same files, archives among them opened. */
export async function openedFiles(files) {
  const opened = files.map(([name, file]) => (kindOf(name) === ".zip" ? unzipped(file) : [[name, file]]));
  return (await Promise.all(opened)).flat();
}

async function walk(entry, found) {
  if (entry.isFile) {
    found.push([entry.fullPath.replace(/^\//, ""), await new Promise((done, failed) => entry.file(done, failed))]);
    return;
  }
  const reader = entry.createReader();
  for (;;) {
    const entries = await new Promise((done, failed) => reader.readEntries(done, failed));
    if (!entries.length) return;
    for (const inner of entries) await walk(inner, found);
  }
}
