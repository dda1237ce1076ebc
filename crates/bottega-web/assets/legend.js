// What the colors over a picture mean.

import { element, setText } from "./format.js";

/** Colors that are named one by one at most. */
const NAMED_MAX = 8;

const color = hue => `hsl(${hue}, 85%, 60%)`;

/** Shows in `place` what the colors of zones mean; `coloring` null: nothing. */
export function colorLegend(place, coloring, summary) {
  const entries = coloring?.legend(summary) ?? [];
  place.hidden = entries.length === 0;
  const key = `${coloring?.name} ${entries.join()}`;
  if (place.hidden || place.dataset.key === key) return;
  place.dataset.key = key;
  if (coloring.isScale) {
    const scale = element("span", { class: "scale-bar", "aria-hidden": "true" });
    // As the hues of zones go: through all between the first and the last.
    const [first, last] = [entries[0][0], entries.at(-1)[0]];
    const stops = Array.from({ length: 9 }, (_, i) => color(first + (last - first) * i / 8));
    scale.style.background = `linear-gradient(to right, ${stops.join(", ")})`;
    place.replaceChildren(element("span", { class: "quiet" }, coloring.name), element("span", { class: "scale-legend" }, scale,
      element("span", { class: "scale-texts" }, entries.map(([, text]) => element("span", {}, text)))));
    return;
  }
  const named = entries.slice(0, NAMED_MAX).map(([hue, text]) => {
    const swatch = element("span", { class: "swatch", "aria-hidden": "true" });
    swatch.style.background = color(hue);
    return element("span", {}, swatch, text);
  });
  const rest = entries.length - named.length;
  place.replaceChildren(element("span", { class: "quiet" }, coloring.name), ...named);
  if (rest > 0) place.append(element("span", { class: "quiet" }, `and ${rest} more, in the table of agents`));
}

/** The legend of the importance map, in the colors of the filter `heat`. */
export function importanceLegend() {
  const place = element("div", { class: "legend", hidden: true });
  const texts = element("span", { class: "scale-texts" }, ...["little", "much"].map(text => element("span", {}, text)));
  const help = element("span", { class: "quiet" });
  setText(help, "Importance: what a pixel is predicted to cost");
  place.append(help, element("span", { class: "scale-legend" }, element("span", { class: "scale-bar heat", "aria-hidden": "true" }), texts));
  return place;
}
