// A new picture: the files of its scene, and the form that a request is made from.

import { ask, get } from "./api.js";
import { button, bytes, element, fileName, setText, words } from "./format.js";
import { LookAround, viewSize } from "./lookaround.js";
import { chosenFiles, droppedFiles, lightOf, openedFiles, scenesOf } from "./scene_files.js";
import { fieldNamed, formOf, requestOf, requestWithout, valueAt } from "./schema_form.js";
import { widget, WrongValue } from "./schema_widgets.js";
import { persist, sendFile } from "./upload.js";

export function showSubmit(page, shell, ofJob) {
  const view = new SubmitPage(page, shell, ofJob);
  view.open();
  return () => view.close();
}

/** A request whose picture is called as its scene, where it has no name. */
export function named(request) {
  const scene = request.scene?.file;
  if (!scene || request.output?.file) return request;
  const frame = request.frames ? ".####" : "";
  return { ...request, output: { ...request.output, file: `${fileName(scene).replace(/\.[^.]*$/, "")}${frame}.exr` } };
}

class SubmitPage {
  isClosed = false;
  #files = new Map();
  #sceneOfJob = null;
  /** What the request of the job says in fields that the form does not have. */
  #others = {};
  #widgets = [];
  #isBusy = false;

  constructor(page, shell, ofJob) {
    Object.assign(this, { shell, ofJob });
    this.list = element("ul", { class: "files" });
    this.scene = element("select", { onchange: () => this.#changed() });
    this.sceneRow = element("p", { hidden: true }, element("label", {}, "Scene ", this.scene));
    this.fields = element("div", {}, element("p", { class: "quiet" }, "Loading the form …"));
    this.json = element("pre", { tabIndex: 0, "aria-label": "The request as JSON" });
    this.send = element("button", { type: "submit", class: "primary" }, "Paint it");
    this.status = element("p", { role: "status", class: "quiet" });
    this.bar = element("progress", { max: 1, value: 0, hidden: true, ariaLabel: "Sending" });
    this.sendRow = element("div", { class: "row send" }, this.send, this.bar, this.status);
    this.form = element("form", { class: "submit", noValidate: true, onsubmit: event => { event.preventDefault(); this.#submit(); } },
      this.#sceneSection(), this.#viewSection(), this.fields,
      element("details", {}, element("summary", {}, "The request as JSON"), this.json),
      this.sendRow);
    page.replaceChildren(element("h1", {}, ofJob ? `The scene of job ${ofJob} again` : "New picture"), this.form);
  }

  async open() {
    const schema = await this.shell.poll(() => get("/schema/request"));
    if (!schema) {
      if (!this.isClosed) setTimeout(() => !this.isClosed && this.open(), 2000);
      return;
    }
    const { main, sections } = formOf(schema);
    const make = field => {
      const made = widget(field, () => this.#changed());
      this.#widgets.push(made);
      return made.element;
    };
    this.fields.replaceChildren(
      element("fieldset", {}, element("legend", {}, "Picture"), element("div", { class: "fields" }, main.map(make))),
      element("h2", {}, "More"),
      ...sections.map(({ name, description, fields }) => element("details", {},
        element("summary", {}, words(name), description ? element("span", { class: "quiet" }, ` ${description.split("\n")[0]}`) : null),
        element("div", { class: "fields" }, fields.map(make)))));
    if (this.ofJob) await this.#takeJob();
    this.#changed();
  }

  #sceneSection() {
    this.sceneNote = element("p", {}, `The scene of job ${this.ofJob}.`);
    this.sceneOrders = element("div");
    if (this.ofJob) return element("fieldset", {}, element("legend", {}, "Scene"), this.sceneNote, this.sceneOrders);
    const taken = async files => {
      try {
        this.#add(await openedFiles(files));
      } catch (error) {
        this.shell.tellProblem(error.message, this.sceneOrders);
      }
    };
    const chooser = (word, properties) => {
      const input = element("input", { type: "file", multiple: true, hidden: true, ...properties });
      input.addEventListener("change", () => { taken(chosenFiles(input.files)); input.value = ""; });
      return [input, button(word, () => input.click())];
    };
    const drop = element("div", { class: "drop" },
      element("p", {}, "Drop a scene here: .glb, .gltf, .usd, .usdz, .xml or .pbrt, with the files and folders that it refers to, or all of it as .zip."),
      element("p", { class: "row" }, chooser("Choose files …", {}), chooser("Choose a folder …", { webkitdirectory: true })));
    const over = isOver => event => { event.preventDefault(); drop.classList.toggle("over", isOver); };
    drop.addEventListener("dragover", over(true));
    drop.addEventListener("dragleave", over(false));
    drop.addEventListener("drop", async event => {
      over(false)(event);
      const files = await this.shell.attempt(() => droppedFiles(event.dataTransfer), this.sceneOrders);
      if (files) taken(files);
    });
    return element("fieldset", {}, element("legend", {}, "Scene"), drop, this.sceneOrders, this.list, this.sceneRow);
  }

  #viewSection() {
    this.view = element("div");
    this.look = button("Look around …", () => this.#lookAround());
    this.lookRow = element("div", { class: "row" }, this.look);
    this.viewNote = element("p", { class: "quiet", role: "status" });
    return element("fieldset", { class: "steers" }, element("legend", {}, "View"), this.lookRow, this.view, this.viewNote);
  }

  /** Shows the scene, so that a camera can be led through it. */
  async #lookAround() {
    if (this.#isBusy) return undefined;
    const request = this.#request();
    if (!request) return this.#showWrong(this.lookRow);
    if (!request.scene?.file) return this.shell.tellProblem("Choose a scene first.", this.lookRow);
    this.around?.close();
    this.#isBusy = true;
    this.look.disabled = true;
    const around = this.around = new LookAround(this.shell, view => this.#takeView(view));
    try {
      const opened = await this.shell.attempt(async () => {
        const submission = await this.#submission(this.#seen(request));
        setText(this.status, "The scene is read …");
        await this.#blamed(() => around.open(submission));
        return true;
      }, this.lookRow);
      if (this.isClosed || !opened) around.close();
      else this.view.replaceChildren(around.element);
    } finally {
      this.#rest();
      this.look.disabled = false;
    }
    return undefined;
  }

  /** A request as it is looked at: small, and of no file. */
  #seen(request) {
    const { output, frames, film, ...rest } = request;
    const size = film?.size ? { size: viewSize(film.size) } : {};
    return { ...rest, film: { ...film, ...size } };
  }

  #takeView({ camera, pose }) {
    const write = (path, value) => this.#widgets.find(it => it.field.path === path)?.write(value);
    write("view.camera", camera ? `${camera}` : "");
    write("view.pose", pose);
    setText(this.viewNote, "The picture will be painted from this view, which is set under “View” below; clear it for the view of the file.");
    this.#changed();
  }

  /** Fills the form with the request of the job. */
  async #takeJob() {
    const request = await this.shell.attempt(() => get(`/jobs/${this.ofJob}/request`), this.sceneOrders);
    if (!request) return;
    this.#sceneOfJob = request.scene.file;
    this.#others = requestWithout(request, ["version", "scene.file", ...this.#widgets.map(it => it.field.path)]);
    // A name that the picture would have anyway follows other fields, such as frames.
    if (request.output?.file === named({ scene: request.scene }).output.file) delete request.output.file;
    for (const { field, write } of this.#widgets) {
      const value = valueAt(request, field.path);
      if (value !== undefined && value !== null) write(value);
    }
    setText(this.sceneNote, `${this.#sceneOfJob}, with all its files, which are in the farm. The form shows the request of job ${this.ofJob}.`);
  }

  #add(files) {
    for (const [name, file] of files) this.#files.set(name, file);
    this.#showFiles();
    const light = lightOf([...this.#files.keys()], this.scene.value);
    const ofLight = this.#widgets.find(it => it.field.path === "environment.light");
    if (light && ofLight && !ofLight.input.value) ofLight.write({ file: light });
    this.#changed();
  }

  #showFiles() {
    const names = [...this.#files.keys()];
    const scenes = scenesOf(names);
    const before = this.scene.value;
    this.scene.replaceChildren(...scenes.map(name => element("option", {}, name)));
    if (scenes.includes(before)) this.scene.value = before;
    this.sceneRow.hidden = scenes.length < 2;
    const line = name => element("li", {}, element("span", {}, name), element("span", { class: "quiet" }, ` ${bytes(this.#files.get(name).size)} `),
      button("×", () => { this.#files.delete(name); this.#showFiles(); this.#changed(); }, { ariaLabel: `Leave ${name} out`, class: "small" }));
    this.list.replaceChildren(...names.map(line));
    this.shell.tellProblem(names.length && !scenes.length ? "None of these files is a scene: .glb, .gltf, .usd, .usdz, .xml or .pbrt, or a .zip with one." : null, this.sceneOrders);
  }

  /** What the form says. Null: something in it is wrong, and is marked. */
  #request() {
    const values = [["scene.file", this.#sceneOfJob ?? (this.scene.value || undefined)]];
    let isRight = true;
    for (const { field, read, tell } of this.#widgets) {
      try {
        values.push([field.path, read()]);
        tell(null);
      } catch (error) {
        if (!(error instanceof WrongValue)) throw error;
        tell(error.message);
        isRight = false;
      }
    }
    return isRight ? named(requestOf(values, this.#others)) : null;
  }

  #changed() {
    const request = this.#request();
    setText(this.json, request ? JSON.stringify(request, null, 2) : "Some field is wrong.");
  }

  async #submit() {
    if (this.#isBusy) return;
    const request = this.#request();
    if (!request) return this.#showWrong(this.sendRow);
    if (!request.scene?.file) return this.shell.tellProblem("Choose a scene first.", this.sendRow);
    this.#isBusy = true;
    this.send.disabled = true;
    try {
      const job = await this.shell.attempt(() => this.#send(request), this.sendRow);
      if (job && !this.isClosed) location.hash = `#/job/${job.job}`;
    } finally {
      this.#rest();
    }
    return undefined;
  }

  #rest() {
    this.#isBusy = false;
    this.send.disabled = false;
    this.bar.hidden = true;
    setText(this.status, "");
  }

  close() {
    this.isClosed = true;
    this.around?.close();
  }

  /** A request with its files, which the farm has then. */
  async #submission(request) {
    return this.ofJob ? { request, files_of_job: this.ofJob } : { request, files: await this.#upload() };
  }

  async #send(request) {
    const submission = await this.#submission(request);
    setText(this.status, "The farm reads the scene …");
    return this.#blamed(() => persist(() => ask("POST", "/jobs", submission)));
  }

  /** Asks for something; what the farm refuses is shown at its field, too. */
  async #blamed(work) {
    try {
      return await work();
    } catch (error) {
      this.#blame(error);
      throw error;
    }
  }

  async #upload() {
    const files = {};
    const names = [...this.#files.keys()];
    this.bar.hidden = false;
    for (const [i, name] of names.entries()) {
      files[name] = await sendFile(name, this.#files.get(name), (step, share) => {
        this.bar.value = share;
        setText(this.status, `${name} (${i + 1} of ${names.length}): ${step}, ${Math.round(100 * share)} %`);
      });
    }
    return files;
  }

  /** Shows which field the farm refuses. */
  #blame(error) {
    const path = fieldNamed(error.detail ?? "", this.#widgets.map(it => it.field.path));
    const wrong = this.#widgets.find(it => it.field.path === path);
    if (!wrong) return;
    wrong.tell(error.detail);
    this.#showWrong();
  }

  /** Leads to the first field that is wrong. `place`: where the button is that was pressed. */
  #showWrong(place) {
    const wrong = this.form.querySelector("[aria-invalid]");
    if (place) this.shell.tellProblem("A field of the form is wrong: it is marked.", place);
    wrong?.closest("details")?.setAttribute("open", "");
    wrong?.focus();
  }
}
