// The fields of a form that was read from a schema.

import { element, words } from "./format.js";

/** What is wrong with what somebody wrote. */
export class WrongValue extends Error {}

const split = text => text.split(/[\s,×x]+/).filter(Boolean);

function number(text, { isInteger }) {
  const value = Number(text);
  if (!Number.isFinite(value) || (isInteger && !Number.isInteger(value))) {
    throw new WrongValue(`“${text}” is not a ${isInteger ? "whole number" : "number"}`);
  }
  return value;
}

/** A text as a value of a field; empty: undefined. Throws a `WrongValue`. */
export function parsed(text, field) {
  const trimmed = text.trim();
  if (!trimmed) return undefined;
  if (field.kind === "string") return trimmed;
  if (field.kind === "number") return number(trimmed, field);
  if (field.kind === "list") return trimmed.split(/\s*,\s*/).filter(Boolean);
  if (field.kind === "tuple") {
    const values = split(trimmed).map(part => number(part, field));
    if (values.length !== field.count) throw new WrongValue(`${field.count} numbers are needed, such as ${example(field)}`);
    return values;
  }
  try {
    return JSON.parse(trimmed);
  } catch (error) {
    throw new WrongValue(`not JSON: ${error.message}`);
  }
}

const example = ({ count, isInteger }) => Array.from({ length: count }, (_, i) => (isInteger ? 640 - 160 * i : 0.5)).join(", ");

/** The default of a field, as a hint. */
export function hint(field) {
  const { default: value } = field;
  if (value === null || value === "") return field.kind === "tuple" ? `automatic, or ${example(field)}` : "automatic";
  if (Array.isArray(value)) return value.join(", ") || "none";
  return typeof value === "object" ? JSON.stringify(value) : `${value}`;
}

const PLAIN = new Map([["string", "text"], ["number", "number"], ["list", "text"], ["tuple", "text"]]);

/** A control with `read()`, which throws a `WrongValue`, and `write(value)`. Undefined is the default. */
function control(field, changed) {
  const events = { oninput: changed, onchange: changed };
  if (PLAIN.has(field.kind)) {
    const inputMode = field.kind === "tuple" ? "decimal" : field.kind === "number" ? (field.isInteger ? "numeric" : "decimal") : "text";
    const input = element("input", { type: "text", inputMode, autocomplete: "off", placeholder: hint(field), ...events });
    return { input, parts: [input], read: () => parsed(input.value, field), write: value => { input.value = [value ?? ""].flat().join(", "); } };
  }
  if (field.kind === "boolean") {
    const input = element("select", events, element("option", { value: "" }, `${field.default ? "yes" : "no"} (default)`),
      element("option", { value: "true" }, "yes"), element("option", { value: "false" }, "no"));
    return { input, parts: [input], read: () => (input.value ? input.value === "true" : undefined), write: value => { input.value = value ?? ""; } };
  }
  if (field.kind === "choice" || field.kind === "variant") return variants(field, changed);
  if (field.kind === "set") return set(field, changed);
  const input = element("textarea", { rows: 2, spellcheck: false, placeholder: hint(field), ...events });
  return { input, parts: [input], read: () => parsed(input.value, field), write: value => { input.value = value === undefined ? "" : JSON.stringify(value); } };
}

function variants(field, changed) {
  const standard = typeof field.default === "string" ? `${field.default} (default)` : "automatic";
  const input = element("select", { onchange: () => { show(); changed(); } }, element("option", { value: "" }, standard),
    field.variants.map(({ name, description }) => element("option", { value: name, title: description }, words(name))));
  const inner = new Map(field.variants.filter(it => it.field).map(it => [it.name, control(it.field, changed)]));
  for (const [name, { input: of }] of inner) of.ariaLabel = `${field.title}: ${words(name)}`;
  const place = element("span", { class: "inner" });
  const show = () => place.replaceChildren(...(inner.get(input.value)?.parts ?? []));
  return {
    input, parts: [input, place],
    read() {
      if (!input.value) return undefined;
      const of = inner.get(input.value);
      if (!of) return input.value;
      const value = of.read();
      if (value === undefined) throw new WrongValue(`“${words(input.value)}” has no value`);
      return { [input.value]: value };
    },
    write(value) {
      const name = value && typeof value === "object" ? Object.keys(value)[0] : value;
      input.value = name ?? "";
      if (value && typeof value === "object") inner.get(name)?.write(value[name]);
      show();
    },
  };
}

function set(field, changed) {
  const box = ({ name, description }) => element("label", { title: description }, element("input", { type: "checkbox", value: name, onchange: changed }), ` ${words(name)}`);
  const input = element("span", { class: "set", role: "group" }, field.variants.map(box));
  const boxes = [...input.querySelectorAll("input")];
  const standard = field.default ?? [];
  const write = value => boxes.forEach(it => { it.checked = (value ?? standard).includes(it.value); });
  write(undefined);
  const read = () => {
    const chosen = boxes.filter(it => it.checked).map(it => it.value);
    return chosen.join() === standard.join() ? undefined : chosen;
  };
  return { input, parts: [input], read, write };
}

let made = 0;

/** A field with its name, its help, and what is wrong with it: `element`, `read()`, `write(value)`, `tell(problem)`. */
export function widget(field, changed) {
  const id = `field-${made++}`;
  const { input, parts, read, write } = control(field, changed);
  const isGroup = field.kind === "set";
  const problem = element("span", { class: "wrong", id: `${id}-wrong`, role: "alert" });
  const help = element("span", { class: "help", id: `${id}-help` }, field.description ?? "");
  input.id = id;
  input.setAttribute("aria-describedby", `${id}-help ${id}-wrong`);
  if (isGroup) input.setAttribute("aria-labelledby", `${id}-name`);
  const name = element(isGroup ? "span" : "label", { class: "field-name", id: `${id}-name`, title: `${field.path}: ${field.description ?? ""}` }, field.title);
  if (!isGroup) name.htmlFor = id;
  const row = element("div", { class: "field" }, name, element("span", { class: "control" }, parts), problem, help);
  return {
    field, element: row, input, write, read,
    tell(text) {
      problem.textContent = text ?? "";
      if (text) input.setAttribute("aria-invalid", "true");
      else input.removeAttribute("aria-invalid");
    },
  };
}
