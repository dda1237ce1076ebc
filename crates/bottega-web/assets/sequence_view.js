// A sequence diagram of any number of messages, of which only those are in the page that are seen.

import { element, oncePerFrame, setText } from "./format.js";
import { agentsOf, conversationHue, labelOf, laneNames } from "./sequence.js";
import { visibleRange } from "./virtual_table.js";

export const ROW = 26;
const LANE = 150;
const MARGIN = 80;
const HEAD = 42;
/** Browsers make no element higher: of more messages the last ones are shown. */
export const ROWS_MAX = 500_000;
const NAMESPACE = "http://www.w3.org/2000/svg";

function shape(name, attributes, ...children) {
  const made = document.createElementNS(NAMESPACE, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

const laneX = lane => MARGIN + lane * LANE;
const widthOf = agents => Math.max(2 * MARGIN, 2 * MARGIN + (agents.length - 1) * LANE);

/** One message as arrows at a height. */
function arrows(message, y, lanes) {
  const from = laneX(lanes.get(message.sender));
  const color = `hsl(${conversationHue(`${message.protocol} ${message.conversation}`)}, 65%, 50%)`;
  const lines = message.receivers.map(receiver => {
    const to = laneX(lanes.get(receiver));
    if (to === from) return shape("path", { d: `M${from} ${y - 5}h18v10h-14`, fill: "none", stroke: color, "stroke-width": 1.6 });
    const side = to > from ? -1 : 1;
    return shape("path", { d: `M${from} ${y}H${to}M${to} ${y}l${7 * side} -4M${to} ${y}l${7 * side} 4`, fill: "none", stroke: color, "stroke-width": 1.6 });
  });
  const ends = message.receivers.map(receiver => laneX(lanes.get(receiver)));
  const left = Math.min(from, ...ends);
  const label = shape("text", { x: left + 8, y: y - 4, "font-size": 11, fill: "currentColor" }, labelOf(message));
  return [...lines, label];
}

/** A drawing of messages as an SVG element that needs no style sheet. */
export function drawing(messages) {
  const agents = agentsOf(messages);
  const [lanes, names] = [new Map(agents.map((agent, i) => [agent, i])), laneNames(agents)];
  const [width, height] = [widthOf(agents) + 160, HEAD + (messages.length + 1) * ROW];
  const svg = shape("svg", { xmlns: NAMESPACE, viewBox: `0 0 ${width} ${height}`, width, height, "font-family": "sans-serif", color: "#1d1e20" });
  svg.append(shape("rect", { width, height, fill: "#ffffff" }));
  agents.forEach((agent, i) => {
    const text = (y, size, words) => shape("text", { x: laneX(i), y, "font-size": size, "text-anchor": "middle", fill: "currentColor" }, words);
    const { name, place } = names.get(agent);
    svg.append(text(14, 11, name), text(27, 9, place),
      shape("line", { x1: laneX(i), x2: laneX(i), y1: HEAD - 10, y2: height, stroke: "#b8b8b4" }));
  });
  messages.forEach((message, i) => svg.append(...arrows(message, HEAD + (i + 1) * ROW, lanes)));
  return svg;
}

/** The diagram: `set(messages)`, `select(index)`; tells `onSelect(message)`. */
export class SequenceView {
  #messages = [];
  #agents = [];
  #lanes = new Map();
  #selected = -1;
  #draw = oncePerFrame(() => this.#drawNow());
  #drawn = "";

  constructor({ label, onSelect }) {
    this.onSelect = onSelect;
    this.heads = element("div", { class: "lanes", "aria-hidden": "true" });
    this.svg = shape("svg", { class: "arrows", "aria-hidden": "true" });
    this.space = element("div", { class: "messages-space" }, this.svg);
    this.element = element("div", { class: "sequence", role: "listbox", "aria-label": `${label}: arrow keys choose a message`, tabIndex: 0 }, this.heads, this.space);
    this.option = element("div", { role: "option", id: "message-chosen", class: "unseen", "aria-selected": "false" }, "No message is chosen");
    this.element.append(this.option);
    this.element.addEventListener("scroll", () => this.#draw(), { passive: true });
    this.element.addEventListener("keydown", event => this.#press(event));
    this.space.addEventListener("click", event => this.#click(event));
    this.observer = new ResizeObserver(() => this.#draw());
    this.observer.observe(this.element);
  }

  close() { this.observer.disconnect(); }

  /** Replaces all messages. `isFollowed`: the last ones are shown. */
  set(messages, isFollowed) {
    const chosen = this.#messages[this.#selected];
    this.#messages = messages.length > ROWS_MAX ? messages.slice(-ROWS_MAX) : messages;
    this.#agents = agentsOf(this.#messages);
    this.#lanes = new Map(this.#agents.map((agent, i) => [agent, i]));
    this.#selected = chosen ? this.#messages.indexOf(chosen) : -1;
    const width = `${widthOf(this.#agents) + 160}px`;
    this.space.style.width = width;
    this.space.style.height = `${(this.#messages.length + 1) * ROW}px`;
    this.heads.style.width = width;
    const key = this.#agents.join("\n");
    if (key !== this.#drawn) {
      this.#drawn = key;
      const names = laneNames(this.#agents);
      this.heads.replaceChildren(...this.#agents.map((agent, i) => {
        const { name, place } = names.get(agent);
        const head = element("span", { class: "lane-name", title: agent }, element("b", {}, name), place ? element("span", { class: "quiet" }, place) : null);
        head.style.left = `${laneX(i)}px`;
        return head;
      }));
    }
    if (isFollowed) this.element.scrollTop = this.element.scrollHeight;
    this.#draw();
  }

  #choose(index) {
    this.#selected = index;
    const message = this.#messages[index];
    setText(this.option, `${labelOf(message)}, from ${message.sender} to ${message.receivers.join(", ")}`);
    this.option.setAttribute("aria-selected", "true");
    this.element.setAttribute("aria-activedescendant", this.option.id);
    const [top, room] = [index * ROW, this.element.clientHeight - HEAD];
    if (top < this.element.scrollTop) this.element.scrollTop = top;
    else if (top + 2 * ROW > this.element.scrollTop + room) this.element.scrollTop = top + 2 * ROW - room;
    this.onSelect(message);
    this.#draw();
  }

  #click(event) {
    const index = Math.round((event.clientY - this.space.getBoundingClientRect().top) / ROW) - 1;
    if (this.#messages.length) this.#choose(Math.max(0, Math.min(this.#messages.length - 1, index)));
  }

  #press(event) {
    const last = this.#messages.length - 1;
    const to = { ArrowDown: this.#selected + 1, ArrowUp: this.#selected - 1, Home: 0, End: last, PageDown: this.#selected + 15, PageUp: this.#selected - 15 }[event.key];
    if (to === undefined || last < 0) return;
    event.preventDefault();
    this.#choose(Math.max(0, Math.min(last, to)));
  }

  #drawNow() {
    const { scrollTop, clientHeight } = this.element;
    const [first, last] = visibleRange(scrollTop, clientHeight, ROW, this.#messages.length);
    const height = (last - first + 2) * ROW;
    const width = widthOf(this.#agents) + 160;
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.svg.setAttribute("width", width);
    this.svg.setAttribute("height", height);
    this.svg.style.top = `${first * ROW}px`;
    const lines = this.#agents.map((_, i) => shape("line", { x1: laneX(i), x2: laneX(i), y1: 0, y2: height, class: "lane" }));
    const marked = this.#selected >= first && this.#selected < last
      ? [shape("rect", { x: 0, y: (this.#selected - first + 0.45) * ROW, width, height: ROW, class: "chosen" })] : [];
    const shown = this.#messages.slice(first, last).flatMap((message, i) => arrows(message, (i + 1) * ROW, this.#lanes));
    this.svg.replaceChildren(...marked, ...lines, ...shown);
  }
}
