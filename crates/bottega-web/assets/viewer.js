// The picture of a job in a window: zoom, exposure, zones and importance over it.

import { button, element, oncePerFrame, setText } from "./format.js";
import { colorLegend, importanceLegend } from "./legend.js";
import { fit, keepInside, toPicture, zoomAt } from "./view_box.js";
import { bounds, COLORINGS, isWorking, stateWord, summarize, timeText, zoneAt } from "./zones.js";

const ZOOM_STEP = 1.25;
const PAN_STEP = 40;
const TAP_DISTANCE = 6;
/** Zones that are smaller on the screen have no text. */
const [LABEL_WIDTH, LABEL_HEIGHT] = [100, 34];
/** Between the lines of their text. */
const LINE = 13;

/** A window with a picture. `onPick` is called with the zone that was clicked, or null. */
export class Viewer {
  #zones = [];
  #summary = summarize([]);
  /** Left, top, right and bottom of the picture; null: not known yet. */
  #frame = null;
  #view = null;
  #isFitted = true;
  #selected = null;
  #pointers = new Map();
  #part = 0;
  draw = oncePerFrame(() => this.#drawNow());

  constructor({ label, onPick }) {
    this.onPick = onPick;
    this.picture = element("img", { class: "picture", alt: label, draggable: false });
    this.over = element("img", { class: "over", alt: "", hidden: true, draggable: false });
    this.importance = element("img", { class: "importance", alt: "", hidden: true, draggable: false });
    this.canvas = element("canvas", { class: "zones", "aria-hidden": "true" });
    this.tip = element("div", { class: "tip", hidden: true });
    this.empty = element("p", { class: "empty" }, "Nothing is painted yet.");
    const help = "Plus and minus zoom, 0 shows the whole picture, arrow keys move it";
    this.stage = element("div", { class: "stage", tabIndex: 0, role: "group", "aria-label": `${label}. ${help}`, title: "" },
      this.picture, this.over, this.importance, this.canvas, this.tip, this.empty);
    this.importance.style.filter = "url(#heat)";
    this.legends = [element("div", { class: "legend", hidden: true }), importanceLegend()];
    this.element = element("div", { class: "viewer" }, this.stage, this.#toolbar(), element("div", { class: "legends" }, this.legends));
    this.#listen();
    this.observer = new ResizeObserver(() => this.#resize());
    this.observer.observe(this.stage);
  }

  /** Replaces all zones. */
  setZones(zones) {
    this.#zones = zones;
    this.#summary = summarize(zones);
    const frame = bounds(zones);
    this.empty.hidden = this.empty.hidden || zones.length > 0;
    if (frame && frame.join() !== this.#frame?.join()) this.#setFrame(frame);
    this.#showLegend();
    this.draw();
  }

  /** The hues of the agents, as zones have them. */
  get hues() { return this.#summary.hues; }

  /** Shows another state of the picture. */
  async show(blob) {
    const before = this.picture.src;
    this.picture.src = URL.createObjectURL(blob);
    await this.picture.decode().catch(() => {});
    if (before) URL.revokeObjectURL(before);
    this.empty.hidden = true;
    const { naturalWidth: width, naturalHeight: height } = this.picture;
    if (!this.#zones.length && width) this.#setFrame([0, 0, width, height]);
    this.draw();
  }

  /** Shows the importance map over the picture; null: no more. */
  showImportance(blob) {
    if (this.importance.src) URL.revokeObjectURL(this.importance.src);
    this.importance.hidden = this.legends[1].hidden = blob === null;
    if (blob) this.importance.src = URL.createObjectURL(blob);
    else this.importance.removeAttribute("src");
    this.draw();
  }

  /** Lays another picture over this one; null: none. `how`: `slider`, `difference` or `flip`. */
  lay(blob, how) {
    if (this.over.src) URL.revokeObjectURL(this.over.src);
    this.over.hidden = blob === null;
    this.over.dataset.how = how ?? "";
    if (blob) this.over.src = URL.createObjectURL(blob);
    else this.over.removeAttribute("src");
    this.draw();
  }

  /** Shows what lies over the picture from so many percent of its width on, with a line there. */
  part(percent) {
    this.over.style.clipPath = percent ? `inset(0 0 0 ${percent}%)` : "";
    this.#part = percent;
    this.draw();
  }

  select(zone) {
    this.#selected = zone?.id ?? null;
    this.draw();
  }

  close() {
    this.observer.disconnect();
    for (const image of [this.picture, this.over, this.importance]) if (image.src) URL.revokeObjectURL(image.src);
  }

  #toolbar() {
    this.scale = element("output", { class: "scale", "aria-label": "Zoom" });
    const redraw = () => { this.#showLegend(); this.draw(); };
    this.showZones = element("input", { type: "checkbox", checked: true, onchange: redraw });
    this.fillZones = element("input", { type: "checkbox", onchange: redraw });
    this.coloring = element("select", { onchange: redraw },
      Object.entries(COLORINGS).map(([value, { name }]) => element("option", { value }, name)));
    this.exposure = element("input", { type: "range", min: -5, max: 5, step: 0.25, value: 0, oninput: () => this.#expose() });
    this.stops = element("output", { class: "stops" }, "0");
    this.extras = element("span", { class: "extras" });
    const exposureHelp = "Brightens the shown picture, in stops. What the preview has cut off stays cut off; the file is not changed";
    return element("div", { class: "toolbar" },
      element("span", { class: "group" },
        button("−", () => this.#zoom(1 / ZOOM_STEP), { title: "Zoom out", ariaLabel: "Zoom out" }), this.scale,
        button("+", () => this.#zoom(ZOOM_STEP), { title: "Zoom in", ariaLabel: "Zoom in" }),
        button("Fit", () => this.#fit(), { title: "Show the whole picture" }),
        button("1:1", () => this.#zoom(1 / (this.#view?.scale ?? 1)), { title: "One pixel of the picture for each of the screen" })),
      element("label", { title: exposureHelp }, "Exposure ", this.exposure, this.stops),
      element("span", { class: "group" }, element("label", {}, this.showZones, " Zones"),
        element("label", { title: "Zones as areas of their color; else as outlines" }, this.fillZones, " Filled")),
      element("label", {}, "Color by ", this.coloring),
      this.extras);
  }

  /** Hides or shows the zones. */
  outline(isShown) {
    this.showZones.checked = isShown;
    this.#showLegend();
    this.draw();
  }

  #showLegend() {
    colorLegend(this.legends[0], this.showZones.checked && this.#zones.length ? COLORINGS[this.coloring.value] : null, this.#summary);
  }

  #expose() {
    const stops = Number(this.exposure.value);
    setText(this.stops, stops > 0 ? `+${stops}` : `${stops}`);
    for (const part of document.querySelectorAll("#exposure [slope]")) part.setAttribute("slope", 2 ** stops);
    for (const image of [this.picture, this.over]) image.style.filter = stops ? "url(#exposure)" : "";
  }

  get #size() { return { width: this.stage.clientWidth, height: this.stage.clientHeight }; }

  get #pictureSize() {
    const [x0, y0, x1, y1] = this.#frame ?? [0, 0, 1, 1];
    return { width: x1 - x0, height: y1 - y0 };
  }

  #setFrame(frame) {
    this.#frame = frame;
    const { width, height } = this.#pictureSize;
    this.stage.style.aspectRatio = `${width} / ${height}`;
    this.#fit();
  }

  #fit() {
    if (!this.#frame) return;
    this.#isFitted = true;
    this.#view = fit(this.#pictureSize, this.#size);
    this.draw();
  }

  #resize() {
    const { width, height } = this.#size;
    const ratio = devicePixelRatio;
    [this.canvas.width, this.canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.#isFitted) this.#fit();
    else this.#drawNow();
  }

  #zoom(factor, point = { x: this.#size.width / 2, y: this.#size.height / 2 }) {
    if (!this.#view) return;
    const least = fit(this.#pictureSize, this.#size).scale;
    this.#view = keepInside(zoomAt(this.#view, factor, point, least), this.#pictureSize, this.#size);
    this.#isFitted = false;
    this.draw();
  }

  #pan(x, y) {
    if (!this.#view) return;
    this.#view = keepInside({ ...this.#view, x: this.#view.x + x, y: this.#view.y + y }, this.#pictureSize, this.#size);
    this.#isFitted = false;
    this.draw();
  }

  #place(event) {
    const { left, top } = this.stage.getBoundingClientRect();
    return { x: event.clientX - left - this.stage.clientLeft, y: event.clientY - top - this.stage.clientTop };
  }

  #zoneUnder(point) {
    if (!this.#view) return null;
    const { x, y } = toPicture(this.#view, point);
    return zoneAt(this.#zones, x + this.#frame[0], y + this.#frame[1]);
  }

  #listen() {
    const { stage } = this;
    stage.addEventListener("wheel", event => {
      event.preventDefault();
      this.#zoom(ZOOM_STEP ** (-event.deltaY / 100), this.#place(event));
    }, { passive: false });
    stage.addEventListener("pointerdown", event => {
      stage.setPointerCapture(event.pointerId);
      this.#pointers.set(event.pointerId, { ...this.#place(event), moved: 0 });
    });
    stage.addEventListener("pointermove", event => this.#move(event));
    stage.addEventListener("pointerup", event => {
      const pointer = this.#pointers.get(event.pointerId);
      this.#pointers.delete(event.pointerId);
      if (pointer && pointer.moved < TAP_DISTANCE && this.showZones.checked) this.onPick(this.#zoneUnder(this.#place(event)));
    });
    stage.addEventListener("pointercancel", event => this.#pointers.delete(event.pointerId));
    stage.addEventListener("pointerleave", () => { this.tip.hidden = true; });
    stage.addEventListener("keydown", event => {
      const does = {
        "+": () => this.#zoom(ZOOM_STEP), "=": () => this.#zoom(ZOOM_STEP), "-": () => this.#zoom(1 / ZOOM_STEP), 0: () => this.#fit(),
        ArrowLeft: () => this.#pan(PAN_STEP, 0), ArrowRight: () => this.#pan(-PAN_STEP, 0),
        ArrowUp: () => this.#pan(0, PAN_STEP), ArrowDown: () => this.#pan(0, -PAN_STEP),
      }[event.key];
      if (!does || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      does();
    });
  }

  #move(event) {
    const point = this.#place(event);
    const pointer = this.#pointers.get(event.pointerId);
    if (!pointer) return this.#hover(point);
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      // Two fingers: what lies between them stays between them.
      const distance = from => Math.hypot(from.x - other.x, from.y - other.y);
      this.#zoom(distance(point) / Math.max(1, distance(pointer)), { x: (point.x + other.x) / 2, y: (point.y + other.y) / 2 });
    } else if (!this.#isFitted) {
      this.#pan(point.x - pointer.x, point.y - pointer.y);
    }
    pointer.moved += Math.hypot(point.x - pointer.x, point.y - pointer.y);
    [pointer.x, pointer.y] = [point.x, point.y];
    return undefined;
  }

  #hover(point) {
    const zone = this.showZones.checked ? this.#zoneUnder(point) : null;
    this.tip.hidden = !zone;
    if (!zone) return;
    setText(this.tip, `Zone ${zone.id}, ${stateWord(zone.state)}${zone.agent ? `, ${zone.agent}` : ""}\n${timeText(zone)}`);
    const isRight = point.x > this.#size.width / 2;
    this.tip.style.left = isRight ? "auto" : `${point.x + 14}px`;
    this.tip.style.right = isRight ? `${this.#size.width - point.x + 14}px` : "auto";
    this.tip.style.top = `${Math.min(point.y + 14, Math.max(0, this.#size.height - 60))}px`;
  }

  #drawNow() {
    if (!this.#view) return;
    const { scale, x, y } = this.#view;
    const { width, height } = this.#pictureSize;
    for (const image of [this.picture, this.over, this.importance]) {
      image.style.width = `${width * scale}px`;
      image.style.height = `${height * scale}px`;
      image.style.transform = `translate(${x}px, ${y}px)`;
      image.classList.toggle("pixels", scale * devicePixelRatio >= 3);
    }
    this.stage.classList.toggle("moves", !this.#isFitted);
    setText(this.scale, `${Math.round(100 * scale)} %`);
    this.#drawZones();
  }

  /** The line between two pictures that are compared, to be seen on both. */
  #drawPart(pen) {
    const at = this.#view.x + this.#pictureSize.width * this.#view.scale * this.#part / 100;
    for (const [color, width] of [["#000", 4], ["#fff", 2]]) {
      pen.fillStyle = color;
      pen.fillRect(at - width / 2, 0, width, this.#size.height);
    }
  }

  #drawZones() {
    const { canvas } = this;
    const pen = canvas.getContext("2d");
    const ratio = devicePixelRatio;
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.scale(ratio, ratio);
    if (this.#part && !this.over.hidden) this.#drawPart(pen);
    if (!this.showZones.checked) return;
    const window = this.#size;
    const { scale, x, y } = this.#view;
    const hueOf = COLORINGS[this.coloring.value].of;
    for (const zone of this.#zones) {
      const left = (zone.rect[0] - this.#frame[0]) * scale + x;
      const top = (zone.rect[1] - this.#frame[1]) * scale + y;
      const [width, height] = [(zone.rect[2] - zone.rect[0]) * scale, (zone.rect[3] - zone.rect[1]) * scale];
      if (left > window.width || top > window.height || left + width < 0 || top + height < 0) continue;
      const [isFilled, isSelected] = [this.fillZones.checked, zone.id === this.#selected];
      drawZone(pen, { zone, left, top, width, height, hue: hueOf(zone, this.#summary), isFilled, isSelected });
    }
  }
}

function drawZone(pen, { zone, left, top, width, height, hue, isFilled, isSelected }) {
  const busy = isWorking(zone);
  const color = alpha => (hue === null ? `hsla(0, 0%, 70%, ${alpha})` : `hsla(${hue}, 85%, 60%, ${alpha})`);
  if (isFilled) {
    pen.fillStyle = color(0.4);
    pen.fillRect(left, top, width, height);
  }
  const edge = isSelected ? 3 : busy ? 2 : 1;
  const outline = (inset, thickness, style) => {
    if (width <= 2 * inset + thickness || height <= 2 * inset + thickness) return;
    pen.lineWidth = thickness;
    pen.strokeStyle = style;
    pen.strokeRect(left + inset, top + inset, width - 2 * inset, height - 2 * inset);
  };
  outline(edge / 2, edge, isSelected ? "#fff" : color(busy ? 1 : 0.75));
  // What is white on white is seen by the line within it.
  if (isSelected) outline(edge + 0.5, 1, "#000");
  if (width < LABEL_WIDTH || height < LABEL_HEIGHT) return;
  pen.font = "11px system-ui, sans-serif";
  pen.lineWidth = 2;
  pen.strokeStyle = "rgba(0, 0, 0, 0.7)";
  pen.fillStyle = "#fff";
  const lines = [stateWord(zone.state), ...timeText(zone).split(", ")].filter(Boolean).slice(0, Math.floor((height - 6) / LINE));
  for (const [i, text] of lines.entries()) {
    pen.strokeText(text, left + 6, top + 15 + LINE * i, width - 10);
    pen.fillText(text, left + 6, top + 15 + LINE * i, width - 10);
  }
}
