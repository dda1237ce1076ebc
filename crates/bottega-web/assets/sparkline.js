// A line of the last values of something.

const SVG = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT] = [80, 20];

/** Values of the last minutes, so many at most. */
export class History {
  #values = [];

  constructor(max) { this.max = max; }

  take(value) {
    this.#values.push(value);
    if (this.#values.length > this.max) this.#values.shift();
  }

  get values() { return this.#values; }
}

/** The corners of the line, as SVG's `points`. */
export function points(values) {
  if (values.length < 2) return "";
  const [min, max] = [Math.min(...values), Math.max(...values)];
  const y = value => (max === min ? HEIGHT / 2 : 1 + (HEIGHT - 2) * (max - value) / (max - min));
  return values.map((value, i) => `${(WIDTH * i / (values.length - 1)).toFixed(1)},${y(value).toFixed(1)}`).join(" ");
}

/** A line: `set(values)`. */
export function sparkline() {
  const svg = document.createElementNS(SVG, "svg");
  for (const [key, value] of Object.entries({ class: "spark", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, "aria-hidden": "true" })) svg.setAttribute(key, value);
  const line = document.createElementNS(SVG, "polyline");
  svg.append(line);
  svg.set = values => line.setAttribute("points", points(values));
  return svg;
}
