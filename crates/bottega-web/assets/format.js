// Numbers and elements for people.

export const percent = share => `${(100 * share).toFixed(0)} %`;

export function time(seconds) {
  if (seconds === undefined || seconds === null) return "–";
  if (seconds < 90) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  return seconds < 5400 ? `${(seconds / 60).toFixed(1)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

export const ago = at => `${time(Date.now() / 1000 - at)} ago`;

/** An element with properties and children. Texts are texts: nothing that a farm says becomes markup. */
export function element(name, properties = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (key in made) made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children.flat().filter(child => child !== null && child !== undefined));
  return made;
}

/** A table of rows of cells. */
export function table(heads, rows) {
  return element("table", {},
    element("thead", {}, element("tr", {}, heads.map(head => element("th", { scope: "col" }, head)))),
    element("tbody", {}, rows.map(cells => element("tr", {}, cells.map(cell => element("td", {}, cell))))));
}
