// A table of any number of rows, of which only those are in the page that are seen.

import { element, oncePerFrame, setText } from "./format.js";

const SPARE_ROWS = 6;

/** Which rows are in a window: from `first`, up to but not including `last`. */
export function visibleRange(scrollTop, height, rowHeight, count, spare = SPARE_ROWS) {
  const first = Math.max(0, Math.min(count, Math.floor(scrollTop / rowHeight)) - spare);
  return [first, Math.min(count, Math.ceil((scrollTop + height) / rowHeight) + spare)];
}

/** Rows by a value; those that have none come last, equal ones stay by key. */
export function sorted(rows, value, key, isDescending) {
  const sign = isDescending ? -1 : 1;
  const isNone = it => it === undefined || it === null;
  const compare = (a, b) => (typeof a === "string" ? a.localeCompare(b) : a - b);
  return rows.map(row => [value(row), key(row), row]).sort(([a, i], [b, j]) => {
    if (isNone(a) || isNone(b)) return isNone(a) - isNone(b) || compare(i, j);
    return sign * compare(a, b) || compare(i, j);
  }).map(([, , row]) => row);
}

/**
 * A table that can be sorted. A column has `name`, `head`, `value` by which it is sorted, `text` or `fill(cell, row)`, and
 * perhaps `help`, `isNumber`, `className`, and `isNeeded(row)`: where no row needs it, it is not shown.
 */
export class VirtualTable {
  #rows = [];
  #byKey = new Map();
  #cells = new Map();
  #selected = null;
  #isLeftOut = [];
  #draw = oncePerFrame(() => this.#drawNow());
  #sort;

  constructor({ label, columns, key, onSelect = null, rowHeight = 36, sort = columns[0].name }) {
    Object.assign(this, { columns, key, onSelect, rowHeight });
    this.#sort = { name: sort, isDescending: false };
    this.heads = columns.map(column => this.#head(column));
    this.above = spacer(columns.length);
    this.below = spacer(columns.length);
    this.body = element("tbody", {}, this.above, this.below);
    this.table = element("table", { "aria-label": label }, element("thead", {}, element("tr", {}, this.heads)), this.body);
    this.element = element("div", { class: "table-window", role: "region", "aria-label": `${label}, scrolls`, tabIndex: 0 }, this.table);
    this.element.addEventListener("scroll", () => this.#draw(), { passive: true });
    this.element.addEventListener("keydown", event => this.#press(event));
    this.observer = new ResizeObserver(() => this.#draw());
    this.observer.observe(this.element);
  }

  /** Replaces all rows. */
  set(rows) {
    const column = this.columns.find(it => it.name === this.#sort.name);
    this.#rows = sorted(rows, column.value, this.key, this.#sort.isDescending);
    this.#byKey = new Map(this.#rows.map((row, i) => [this.key(row), i]));
    this.#isLeftOut = this.columns.map(it => Boolean(it.isNeeded) && !rows.some(it.isNeeded));
    this.heads.forEach((head, i) => { head.hidden = this.#isLeftOut[i]; });
    this.#draw();
  }

  /** Marks a row, and scrolls to it. */
  select(key) {
    this.#selected = key;
    const at = this.#byKey.get(key);
    if (at !== undefined) {
      const [top, room] = [at * this.rowHeight, this.element.clientHeight - this.table.tHead.offsetHeight];
      const { scrollTop } = this.element;
      if (top < scrollTop || top + this.rowHeight > scrollTop + room) this.element.scrollTop = top - room / 2;
    }
    this.#draw();
  }

  close() { this.observer.disconnect(); }

  #head(column) {
    const sort = element("button", { type: "button", title: column.help, onclick: () => this.#sortBy(column) }, column.head);
    const head = element("th", { scope: "col", class: classOf(column) }, sort);
    if (column.name === this.#sort.name) head.setAttribute("aria-sort", "ascending");
    return head;
  }

  #sortBy(column) {
    const isDescending = this.#sort.name === column.name ? !this.#sort.isDescending : Boolean(column.isNumber && column !== this.columns[0]);
    this.#sort = { name: column.name, isDescending };
    this.heads.forEach((head, i) => {
      if (this.columns[i] === column) head.setAttribute("aria-sort", isDescending ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    });
    this.set(this.#rows);
  }

  #press(event) {
    if (event.target !== this.element || !this.onSelect || !this.#rows.length) return;
    const at = this.#byKey.get(this.#selected);
    const last = this.#rows.length - 1;
    const to = { ArrowDown: at === undefined ? 0 : at + 1, ArrowUp: at === undefined ? 0 : at - 1, Home: 0, End: last }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    this.#choose(this.#rows[Math.min(last, Math.max(0, to))]);
  }

  #choose(row) {
    this.select(this.key(row));
    this.onSelect(row);
  }

  #drawNow() {
    const { scrollTop, clientHeight } = this.element;
    const [first, last] = visibleRange(scrollTop, clientHeight, this.rowHeight, this.#rows.length);
    this.table.setAttribute("aria-rowcount", this.#rows.length + 1);
    this.above.firstChild.style.height = `${first * this.rowHeight}px`;
    this.below.firstChild.style.height = `${(this.#rows.length - last) * this.rowHeight}px`;
    const shown = new Map();
    let before = this.above;
    for (let i = first; i < last; i++) {
      const row = this.#rows[i];
      const key = this.key(row);
      const line = this.#cells.get(key) ?? this.#line(key);
      shown.set(key, line);
      this.#fill(line, row, i);
      if (before.nextSibling !== line) before.after(line);
      before = line;
    }
    for (const [key, line] of this.#cells) if (!shown.has(key)) line.remove();
    this.#cells = shown;
  }

  #line(key) {
    const line = element("tr", {}, this.columns.map(column => element("td", { class: classOf(column) })));
    line.style.height = `${this.rowHeight}px`;
    if (this.onSelect) {
      line.addEventListener("click", event => {
        const at = this.#byKey.get(key);
        if (at !== undefined && !event.target.closest("button, a, input")) this.#choose(this.#rows[at]);
      });
    }
    return line;
  }

  #fill(line, row, at) {
    line.setAttribute("aria-rowindex", at + 2);
    if (this.key(row) === this.#selected) line.setAttribute("aria-current", "true");
    else line.removeAttribute("aria-current");
    this.columns.forEach((column, i) => {
      const cell = line.children[i];
      cell.hidden = this.#isLeftOut[i];
      if (column.fill) column.fill(cell, row);
      else setText(cell, column.text(row));
    });
  }
}

const classOf = ({ className = "", isNumber }) => `${className}${isNumber ? " number" : ""}`.trim();

function spacer(columns) {
  return element("tr", { class: "spacer", "aria-hidden": "true" }, element("td", { colSpan: columns }));
}
