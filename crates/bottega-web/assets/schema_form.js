// The fields of a form, read from the JSON Schema of a request.

import { words } from "./format.js";

/** Fields that come first, in this order, and their labels. */
const MAIN_FIELDS = new Map([
  ["film.size", "Width and height"], ["goal.samples", "Samples per pixel"], ["goal.error", "Error at most"], ["film.denoise", "Denoise"],
  ["environment.light", "Environment light"], ["environment.strength", "Environment strength"], ["view.camera", "Camera"],
  ["output.file", "File of the picture"], ["output.exposure", "Exposure of a PNG, in stops"], ["farm.priority", "Priority"],
]);

/** Fields that a page cannot set: files and programs of the painting machines, and what jobs of a farm cannot have. */
const LEFT_OUT = new Set([
  "version", "devices", "scene.file", "scene.asset_roots", "scene.allow_outside", "engine.trust", "engine.manifests",
  "work.agents", "goal.time",
]);

/** Follows references and takes `null` out: the schema itself, with what was said of it on the way. */
function resolve(node, root) {
  let [schema, isNullable] = [node, false];
  const said = {};
  for (;;) {
    for (const key of ["description", "default"]) if (schema[key] !== undefined && said[key] === undefined) said[key] = schema[key];
    const choices = schema.anyOf?.filter(it => it.type !== "null");
    if (choices?.length === 1) [schema, isNullable] = [choices[0], true];
    else if (schema.$ref) schema = root.$defs[schema.$ref.split("/").pop()];
    else break;
  }
  const types = [schema.type ?? []].flat();
  return { ...schema, ...said, type: types.find(type => type !== "null"), isNullable: isNullable || types.includes("null") };
}

/** The kind of input for a value. */
function kindOf(schema, root) {
  const { type } = schema;
  if (schema.oneOf) {
    const variants = schema.oneOf.map(variant => variantOf(variant, root));
    return variants.every(variant => variant.field === null) ? { kind: "choice", variants } : { kind: "variant", variants };
  }
  if (type === "boolean" || type === "string") return { kind: type };
  if (type === "integer" || type === "number") return { kind: "number", isInteger: type === "integer", min: schema.minimum, max: schema.maximum };
  if (type === "array") {
    const items = resolve(schema.items, root);
    if (schema.minItems !== undefined && schema.minItems === schema.maxItems) {
      return { kind: "tuple", count: schema.minItems, isInteger: items.type === "integer" };
    }
    if (items.type === "string" && !items.oneOf) return { kind: "list" };
    if (items.oneOf?.every(variant => variant.const !== undefined)) {
      return { kind: "set", variants: items.oneOf.map(variant => variantOf(variant, root)) };
    }
  }
  return { kind: "json" };
}

/** One of several forms of a value: a constant, or an object with one field. */
function variantOf(schema, root) {
  if (schema.const !== undefined) return { name: schema.const, description: schema.description, field: null };
  const [[name, node]] = Object.entries(schema.properties);
  return { name, description: schema.description, field: fieldOf(name, node, root) };
}

function fieldOf(path, node, root) {
  const schema = resolve(node, root);
  const { description, isNullable } = schema;
  const name = path.split(".").pop();
  return { path, title: words(name), description, default: schema.default ?? null, isNullable, ...kindOf(schema, root) };
}

/** The fields of a request: the main ones, and the others by section. */
export function formOf(root) {
  const [all, sections] = [new Map(), []];
  for (const [name, node] of Object.entries(root.properties)) {
    if (LEFT_OUT.has(name)) continue;
    const schema = resolve(node, root);
    const isSection = schema.type === "object" && schema.properties;
    const named = isSection ? Object.entries(schema.properties).map(([field, it]) => [`${name}.${field}`, it]) : [[name, node]];
    const fields = named.filter(([path]) => !LEFT_OUT.has(path)).map(([path, it]) => fieldOf(path, it, root));
    fields.forEach(field => all.set(field.path, field));
    const rest = fields.filter(field => !MAIN_FIELDS.has(field.path));
    if (rest.length) sections.push({ name, description: schema.description, fields: rest });
  }
  return { main: [...MAIN_FIELDS].filter(([path]) => all.has(path)).map(([path, title]) => ({ ...all.get(path), title })), sections };
}

/** Puts values by path into a request; those that are undefined are left out: the default holds. `others`: what it has beside. */
export function requestOf(values, others = {}) {
  const request = structuredClone(others);
  for (const [path, value] of values) {
    if (value === undefined) continue;
    const parts = path.split(".");
    const last = parts.pop();
    let place = request;
    for (const part of parts) place = place[part] ??= {};
    place[last] = value;
  }
  return request;
}

/** What a request says at a path. */
export const valueAt = (request, path) => path.split(".").reduce((place, part) => place?.[part], request);

/** A request without the fields of some paths, and without sections that are empty then. */
export function requestWithout(request, paths) {
  const rest = structuredClone(request);
  for (const path of paths) {
    const parts = path.split(".");
    const last = parts.pop();
    const place = parts.reduce((it, part) => it?.[part], rest);
    if (place) delete place[last];
    if (parts.length === 1 && place && !Object.keys(place).length) delete rest[parts[0]];
  }
  return rest;
}

/** The field that an answer complains of: the longest known path that its text names. */
export function fieldNamed(text, paths) {
  const named = [...text.matchAll(/`([a-z_]+(?:\.[a-z_]+)*)[^`]*`/g)].map(match => match[1]);
  const found = named.flatMap(name => paths.filter(path => name === path || name.startsWith(`${path}.`)));
  return found.sort((a, b) => b.length - a.length)[0] ?? null;
}
