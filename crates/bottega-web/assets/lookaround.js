// A scene looked around in: a picture that is painted again from wherever one drags the camera to.

import { ask, fetchFrame } from "./api.js";
import { button, element, setText } from "./format.js";
import { dolly, levelUp, orbit, pan } from "./orbit.js";

/** Of a picture that is looked around in, in pixels. */
const [WIDTH_MAX, HEIGHT_MAX] = [720, 480];
const DRAG_ANGLE = Math.PI;
const KEY_ANGLE = Math.PI / 24;
const KEY_SHARE = 0.05;
const WHEEL_FACTOR = 1.0015;
const ZOOM_STEP = 0.87;

/** The largest picture of this shape that is soon painted. */
export function viewSize([width, height]) {
  const scale = Math.min(1, WIDTH_MAX / width, HEIGHT_MAX / height);
  return [Math.max(1, Math.round(width * scale)), Math.max(1, Math.round(height * scale))];
}

/** A view as options of `bottega render`. */
export function viewOptions({ camera, pose }) {
  const rounded = Object.entries(pose).filter(([, value]) => value !== null)
    .map(([key, value]) => [key, Array.isArray(value) ? value.map(number => Number(number.toFixed(4))) : value]);
  return `${camera ? `--camera ${camera} ` : ""}--set 'view.pose=${JSON.stringify(Object.fromEntries(rounded))}'`;
}

/**
 * A place to look around in; `onTake` is called with `{ camera, pose }` of the view that is taken. Null: nobody can take it, and the
 * view is written out in place of a button.
 */
export class LookAround {
  #viewport = null;
  #camera = 0;
  #pose = null;
  #pointers = new Map();
  #isSending = false;
  #isStale = false;
  #sent = [];
  #first = null;
  /** Aborts requests under way when the viewport is closed: nothing answers them any more. */
  #abort = new AbortController();
  isClosed = false;

  constructor(shell, onTake) {
    Object.assign(this, { shell, onTake });
    this.picture = element("img", { class: "looked", alt: "The scene as the camera sees it", draggable: false });
    this.picture.hidden = true;
    const help = "Drag to go around, with Shift or two fingers to move sideways, wheel or pinch to come closer. Arrow keys, plus and minus do the same";
    this.stage = element("div", { class: "stage around moves", tabIndex: 0, role: "group", "aria-label": `The scene. ${help}` }, this.picture);
    this.cameras = element("select", { ariaLabel: "Camera of the scene", onchange: () => this.#takeCamera(Number(this.cameras.value)) });
    this.status = element("output", { class: "quiet" });
    this.toolbar = element("div", { class: "toolbar" },
      element("label", {}, "Camera ", this.cameras),
      button("Back to the camera", () => this.#takeCamera(this.#camera), { title: "The position in the file" }),
      onTake ? button("Take this view", () => this.#take(), { class: "primary" }) : null, this.status);
    this.written = onTake ? null : element("pre", { tabIndex: 0, ariaLabel: "The options that paint this view" });
    this.element = element("div", { class: "viewer" },
      ...[this.stage, this.toolbar, element("p", { class: "quiet hint" }, `${help}.`), this.written].filter(Boolean));
    this.#listen();
    this.#leave = () => this.close();
    addEventListener("pagehide", this.#leave);
  }

  #leave;

  /** Opens a scene: `submission` is a request with its files. */
  async open(submission) {
    const opened = await ask("POST", "/viewports", submission);
    if (this.isClosed) return this.#end(opened.viewport);
    this.#viewport = opened;
    this.stage.style.aspectRatio = `${opened.width} / ${opened.height}`;
    this.cameras.replaceChildren(...opened.cameras.map(({ name }, i) => element("option", { value: i }, name ? `${i}: ${name}` : `${i}`)));
    const named = submission.request.view?.camera;
    const found = opened.cameras.findIndex(({ name }, i) => name === named || `${i}` === named);
    this.#camera = Math.max(0, found);
    this.cameras.value = this.#camera;
    this.#pose = this.#level(submission.request.view?.pose ?? opened.cameras[this.#camera].pose);
    this.#write();
    this.#watch();
    return undefined;
  }

  /** Writes the view out as options of `bottega render`. */
  #write() {
    if (this.written) setText(this.written, viewOptions({ camera: this.#camera, pose: this.#pose }));
  }

  /** Ends it. */
  close() {
    if (this.isClosed) return;
    this.isClosed = true;
    this.#abort.abort();
    removeEventListener("pagehide", this.#leave);
    if (this.picture.src) URL.revokeObjectURL(this.picture.src);
    if (this.#viewport) this.#end(this.#viewport.viewport);
  }

  #end(viewport) { fetch(`/api/viewports/${viewport}`, { method: "DELETE", keepalive: true }).catch(() => {}); }

  #level(pose) { return { ...pose, up: levelUp(pose.up ?? [0, 1, 0]) }; }

  /** Shows frame after frame. */
  async #watch() {
    let [tag, misses] = [null, 0];
    const begun = performance.now();
    while (!this.isClosed) {
      const frame = await this.shell.poll(() => this.#fetch(tag), error => {
        this.shell.tellProblem(error.message, this.toolbar);
        this.close();
      });
      if (frame === undefined && ++misses > 20) return;
      if (!frame) {
        if (frame === undefined) await new Promise(done => setTimeout(done, 500));
        continue;
      }
      ({ tag } = frame);
      misses = 0;
      await this.#show(frame);
      this.#first ??= performance.now() - begun;
      const sent = this.#sent.find(({ look }) => look === frame.look);
      if (sent) this.stage.dataset.restart = Math.round(performance.now() - sent.at);
      this.#sent = this.#sent.filter(({ look }) => look > frame.look);
      this.stage.dataset.first = Math.round(this.#first);
    }
  }

  /** Waits for another frame than the one of `tag`; null: there is none, or the view is closed. */
  #fetch(tag) {
    return fetchFrame(`/viewports/${this.#viewport.viewport}/frame.png`, tag, this.#abort.signal).catch(error => {
      if (this.isClosed) return null;
      throw error;
    });
  }

  async #show({ blob, look, samples, isDenoised, machines, bytesPerSecond }) {
    const before = this.picture.src;
    this.picture.src = URL.createObjectURL(blob);
    await this.picture.decode().catch(() => {});
    if (before) URL.revokeObjectURL(before);
    this.picture.hidden = false;
    Object.assign(this.stage.dataset, { look, samples, machines });
    const by = machines > 1 ? `, ${machines} machines, ${(bytesPerSecond / 1e6).toFixed(1)} MB/s` : "";
    const of = `${Math.min(samples, this.#viewport.samples)} of ${this.#viewport.samples} samples`;
    setText(this.status, samples === 0 ? "coarse" : `${of}${isDenoised ? ", noise removed" : ""}${by}`);
  }

  #takeCamera(number) {
    this.#camera = number;
    this.#move(this.#level(this.#viewport.cameras[number].pose), { isOwn: true });
  }

  /** The view as a request says it. */
  #view({ isOwn = false } = {}) {
    const camera = this.#camera ? { camera: `${this.#camera}` } : {};
    return isOwn ? camera : { ...camera, pose: this.#pose };
  }

  /** Looks from elsewhere; while one move is sent, of the others the last one counts. */
  async #move(pose, options) {
    this.#pose = pose;
    this.stage.dataset.eye = pose.eye.map(value => value.toFixed(3)).join(" ");
    this.#isStale = true;
    this.#write();
    if (this.#isSending) return;
    this.#isSending = true;
    while (this.#isStale && !this.isClosed) {
      this.#isStale = false;
      const at = performance.now();
      const answer = await this.shell.attempt(() => ask("PUT", `/viewports/${this.#viewport.viewport}/view`, this.#view(options)), this.toolbar);
      if (answer) this.#sent.push({ look: answer.look, at });
    }
    this.#isSending = false;
  }

  #take() {
    if (this.#viewport) this.onTake({ camera: this.#camera, pose: this.#pose });
  }

  #listen() {
    const { stage } = this;
    const by = change => { if (this.#pose) this.#move(change(this.#pose)); };
    stage.addEventListener("wheel", event => {
      event.preventDefault();
      by(pose => dolly(pose, WHEEL_FACTOR ** event.deltaY));
    }, { passive: false });
    stage.addEventListener("contextmenu", event => event.preventDefault());
    stage.addEventListener("pointerdown", event => {
      stage.setPointerCapture(event.pointerId);
      this.#pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    const lift = event => this.#pointers.delete(event.pointerId);
    stage.addEventListener("pointerup", lift);
    stage.addEventListener("pointercancel", lift);
    stage.addEventListener("pointermove", event => this.#drag(event));
    stage.addEventListener("keydown", event => {
      const turn = (across, along) => pose => (event.shiftKey ? pan(pose, -across / KEY_ANGLE * KEY_SHARE, -along / KEY_ANGLE * KEY_SHARE) : orbit(pose, across, along));
      const does = {
        ArrowLeft: turn(-KEY_ANGLE, 0), ArrowRight: turn(KEY_ANGLE, 0), ArrowUp: turn(0, KEY_ANGLE), ArrowDown: turn(0, -KEY_ANGLE),
        "+": pose => dolly(pose, ZOOM_STEP), "=": pose => dolly(pose, ZOOM_STEP), "-": pose => dolly(pose, 1 / ZOOM_STEP),
      }[event.key];
      if (!does || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      by(does);
    });
  }

  #drag(event) {
    const pointer = this.#pointers.get(event.pointerId);
    if (!pointer || !this.#pose) return;
    const { width, height } = this.stage.getBoundingClientRect();
    const [dx, dy] = [event.clientX - pointer.x, event.clientY - pointer.y];
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    let pose = this.#pose;
    if (other) {
      const distance = from => Math.max(1, Math.hypot(from.x - other.x, from.y - other.y));
      pose = dolly(pan(pose, dx / 2 / height, dy / 2 / height), distance(pointer) / distance({ x: event.clientX, y: event.clientY }));
    } else if (event.shiftKey || event.buttons !== 1) {
      pose = pan(pose, dx / height, dy / height);
    } else {
      pose = orbit(pose, -dx / width * DRAG_ANGLE, dy / height * DRAG_ANGLE);
    }
    [pointer.x, pointer.y] = [event.clientX, event.clientY];
    this.#move(pose);
  }
}
