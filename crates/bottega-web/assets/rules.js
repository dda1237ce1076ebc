// The rules of a job: the functions of their terms drawn, and which rules fire for a zone, and why.

import { get } from "./api.js";
import { element, setText } from "./format.js";

const [WIDTH, HEIGHT, MARGIN] = [280, 110, 18];
const NAMESPACE = "http://www.w3.org/2000/svg";

/** The points of a term's function from the left edge of its variable's range to the right one. */
export function outline({ points }, [low, high]) {
  if (points.length === 1) return [[points[0][0], 0], [points[0][0], 1], [points[0][0], 0]];
  const first = points[0];
  const last = points[points.length - 1];
  return [...(first[0] > low ? [[low, first[1]]] : []), ...points, ...(last[0] < high ? [[high, last[1]]] : [])];
}

/** Where a value stands in a drawing, in its pixels. */
export function placeX(value, [low, high], width = WIDTH) {
  const share = high > low ? (value - low) / (high - low) : 0.5;
  return Math.min(1, Math.max(0, share)) * (width - 2 * MARGIN) + MARGIN;
}

/** A number for people, of any size. */
export const short = value => (Number.isInteger(value) ? `${value}` : Number(value.toPrecision(3)).toString());

/** What a zone is, in a sentence for each input: `complexity 3: big 0.75, normal 0.25`. */
export function inputText({ name, value, terms }) {
  const held = [...terms].sort((a, b) => b[1] - a[1]).map(([term, degree]) => `${term} ${degree.toFixed(2)}`);
  return `${name.replaceAll("_", " ")} is ${short(value)}: ${held.join(", ") || "no term holds"}`;
}

function shape(name, attributes, ...children) {
  const made = document.createElementNS(NAMESPACE, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

/** The functions of a variable's terms; with a mark where a value stands. */
function plot({ name, range, terms }, value) {
  const y = degree => HEIGHT - MARGIN - degree * (HEIGHT - 2.4 * MARGIN);
  const title = `Terms of ${name}: ${terms.map(term => term.name).join(", ")}${value === undefined || value === null ? "" : `; the zone has ${short(value)}`}`;
  const svg = shape("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": title, class: "membership" });
  svg.append(shape("path", { d: `M${MARGIN} ${y(0)}H${WIDTH - MARGIN}`, class: "axis" }));
  terms.forEach((term, i) => {
    const hue = Math.round((205 + i * 137.508) % 360);
    const points = outline(term, range);
    const line = points.map(([x, degree]) => `${placeX(x, range).toFixed(1)},${y(degree).toFixed(1)}`).join(" ");
    const [top] = points.reduce((best, point) => (point[1] > best[1] ? point : best));
    const peaks = points.filter(point => point[1] === 1).map(([x]) => x);
    const at = peaks.length ? (peaks[0] + peaks[peaks.length - 1]) / 2 : top;
    svg.append(shape("polyline", { points: line, stroke: `hsl(${hue}, 65%, 50%)`, class: "term" }),
      shape("text", { x: placeX(at, range), y: y(1) - 4 - (i % 2) * 9, "text-anchor": "middle" }, term.name));
  });
  if (value !== undefined && value !== null) svg.append(shape("path", { d: `M${placeX(value, range).toFixed(1)} ${y(0)}V${y(1)}`, class: "mark" }));
  svg.append(shape("text", { x: MARGIN, y: HEIGHT - 4 }, short(range[0])), shape("text", { x: WIDTH - MARGIN, y: HEIGHT - 4, "text-anchor": "end" }, short(range[1])));
  return element("figure", {}, svg, element("figcaption", {}, name.replaceAll("_", " ")));
}

/** The section of the rules: `choose(zone)` shows what they say of a zone; null: of none. */
export class RulesSection {
  #rules = null;
  #zone = null;
  #latest = 0;

  constructor(shell, number) {
    Object.assign(this, { shell, number });
    this.state = element("p", { class: "quiet", role: "status" });
    this.body = element("div");
    const help = "Fuzzy rules: the knowledge of agents about painting, as rules over terms such as small or big, which apply to a degree";
    this.element = element("details", { class: "rules", ontoggle: () => this.#show() }, element("summary", { title: help }, "Rules"), this.state, this.body);
  }

  choose(zone) {
    const id = zone?.id ?? null;
    if (id === this.#zone) return;
    this.#zone = id;
    this.#show();
  }

  async #show() {
    if (!this.element.open) return;
    const request = ++this.#latest;
    const tell = error => setText(this.state, error.message);
    if (!this.#rules?.inputs) this.#rules = await this.shell.poll(() => get(`/jobs/${this.number}/rules`), tell) ?? null;
    const of = this.#rules && this.#zone !== null ? await this.shell.poll(() => get(`/jobs/${this.number}/zones/${this.#zone}/rules`), tell) ?? null : null;
    if (request !== this.#latest || !this.#rules) return;
    setText(this.state, this.#stateText(of));
    this.body.replaceChildren(...this.#rules.sets.map(set => this.#set(set, of?.verdicts.find(verdict => verdict.set === set.name))));
  }

  #stateText(of) {
    if (!this.#rules.inputs) return "The picture is not cut into zones yet: the terms are drawn as they are written.";
    if (this.#rules.inputs.level === null) return "Optimization is off: no rules apply, and every zone is painted with the requested settings (--optimize switches it on).";
    if (!of) return "Choose a zone: its values are marked, and the rules that fire are shown.";
    return of.reasons ? `Zone ${of.zone}: its agent applied ${of.reasons}.` : `Zone ${of.zone}: nobody has decided on it yet.`;
  }

  #set(set, verdict) {
    const values = new Map(verdict?.inputs.map(input => [input.name, input.value]));
    const results = new Map(verdict?.outputs);
    const plots = element("div", { class: "plots" },
      set.inputs.map(input => plot(input, values.get(input.name))), set.outputs.map(output => plot(output, results.get(output.name))));
    const fired = verdict?.rules.map(({ label, degree, text }) => element("li", {},
      element("meter", { min: 0, max: 1, value: degree, ariaLabel: `Rule ${label} fires` }), ` ${degree.toFixed(2)}  ${label}: ${text}`));
    const why = verdict ? [
      element("h4", {}, "What the zone is"), element("ul", {}, verdict.inputs.map(input => element("li", {}, inputText(input)))),
      element("h4", {}, "Which rules fire"), element("ol", { class: "fired" }, fired),
      element("h4", {}, "What they decide"),
      element("ul", {}, verdict.outputs.map(([name, value]) => element("li", {}, `${name.replaceAll("_", " ")}: ${value === null ? "as requested" : short(value)}`))),
    ] : [];
    const all = element("details", {}, element("summary", {}, `All ${set.rules.length} rules`),
      element("ol", { class: "fired" }, set.rules.map(({ label, text }) => element("li", {}, `${label}: ${text}`))));
    return element("section", { ariaLabel: set.name }, element("h3", {}, set.name), plots, why, all);
  }
}
