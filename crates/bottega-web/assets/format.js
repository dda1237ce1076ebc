// Numbers and elements for people.

export const percent = share => `${(100 * share).toFixed(0)} %`;

export function time(seconds) {
  if (seconds === undefined || seconds === null) return "–";
  if (seconds === 0) return "0 s";
  if (seconds > 0 && seconds < 0.0995) return `${Math.max(1, Math.round(1000 * seconds))} ms`;
  if (seconds < 90) return `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
  return seconds < 5400 ? `${(seconds / 60).toFixed(1)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

export function ago(at) {
  const seconds = Date.now() / 1000 - at;
  return seconds < 1 ? "just now" : `${time(seconds)} ago`;
}

/** A number with so many decimals, or a dash. */
export const decimals = (value, count) => (value === undefined || value === null ? "–" : value.toFixed(count));

/** `1 zone`, `2 zones`. */
export const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;

export function bytes(count) {
  const units = ["bytes", "KB", "MB", "GB"];
  let unit = 0;
  while (count >= 1000 && unit < units.length - 1) [count, unit] = [count / 1000, unit + 1];
  return `${unit === 0 ? count : count.toFixed(1)} ${units[unit]}`;
}

/** `zone_min_size` as people write it: "Zone min size". */
export function words(name) {
  const text = name.replaceAll("_", " ");
  return text[0].toUpperCase() + text.slice(1);
}

/** The last part of a path. */
export const fileName = path => path.split(/[\\/]/).pop();

/** An element with properties and children. Texts are texts: nothing that a farm says becomes markup. */
export function element(name, properties = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (value === undefined || value === null) continue;
    if (key in made) made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children.flat(Infinity).filter(child => child !== null && child !== undefined));
  return made;
}

/** Sets a text where it is another one: what is selected stays selected. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

export function button(word, onclick, properties = {}) {
  return element("button", { type: "button", onclick, ...properties }, word);
}

/** A function that has something drawn with the next frame, once however often it is called before. */
export function oncePerFrame(draw) {
  let isWaiting = false;
  return () => {
    if (isWaiting) return;
    isWaiting = true;
    requestAnimationFrame(() => {
      isWaiting = false;
      draw();
    });
  };
}
