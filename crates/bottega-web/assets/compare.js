// The picture of a job held against another one: by a slider, by what differs, by what the eye sees of that.

import { ask, fetchPicture, get } from "./api.js";
import { button, element, setText } from "./format.js";

const MODES = {
  slider: { name: "Slider", help: "The other picture lies to the right of the slider" },
  difference: { name: "Difference", help: "What differs in the pictures as they are shown; black: nothing" },
  flip: { name: "FLIP", help: "What the eye sees of it: black nothing, yellow a plain difference" },
};

/** What two pictures differ in, for people. */
export function differenceText({ flip, flip_visible_share: share, rel_mse: relMse, rmse }) {
  return `FLIP ${flip.toFixed(4)}, seen in ${(100 * share).toFixed(1)} % of the pixels; relMSE ${relMse.toExponential(2)}, RMSE ${rmse.toExponential(2)}`;
}

/** The controls of a comparison; they lay pictures over that of `viewer`. */
export class Comparison {
  #other = null;

  constructor(shell, viewer, number) {
    Object.assign(this, { shell, viewer, number });
    this.others = element("select", { ariaLabel: "Compare with", onchange: () => this.#choose(), onfocus: () => this.#list() },
      element("option", { value: "" }, "nothing"));
    this.mode = element("select", { ariaLabel: "Way to compare", onchange: () => this.#show() },
      Object.entries(MODES).map(([value, { name, help }]) => element("option", { value, title: help }, name)));
    this.slider = element("input", { type: "range", min: 0, max: 100, step: 0.5, value: 50, ariaLabel: "Slider", oninput: () => this.#slide() });
    this.figures = element("output", { class: "quiet" });
    const input = element("input", { type: "file", hidden: true, accept: ".png,.exr,.hdr", ariaLabel: "Picture to compare with" });
    input.addEventListener("change", () => { if (input.files[0]) this.#send(input.files[0]); input.value = ""; });
    this.ways = element("span", { class: "group", hidden: true }, this.mode, this.slider);
    this.element = element("div", { class: "toolbar compare" }, element("label", {}, "Compare with ", this.others),
      button("a file …", () => input.click(), { class: "steers", title: "A PNG, OpenEXR or Radiance file; it may be dropped on the picture" }), input, this.ways, this.figures);
    const { stage } = viewer;
    stage.addEventListener("dragover", event => event.preventDefault());
    stage.addEventListener("drop", event => {
      event.preventDefault();
      const [file] = event.dataTransfer.files;
      if (file) this.#send(file);
    });
  }

  /** Lists the pictures that there are. */
  async #list() {
    const jobs = await this.shell.poll(() => get("/jobs"));
    if (!jobs) return;
    const known = new Map([...this.others.options].map(option => [option.value, option]));
    for (const job of jobs.filter(it => it.kept && it.job !== this.number).reverse()) {
      if (!known.has(`job-${job.job}`)) this.others.append(element("option", { value: `job-${job.job}` }, `job ${job.job}: ${job.output}`));
    }
  }

  async #send(file) {
    const sent = await this.shell.attempt(() => ask("POST", "/pictures", file), this.element);
    if (!sent) return;
    const value = `picture-${sent.picture}`;
    this.others.append(element("option", { value }, file.name));
    this.others.value = value;
    await this.#choose();
  }

  async #choose() {
    this.#other = this.others.value || null;
    setText(this.figures, "");
    this.ways.hidden = this.#other === null;
    // What is written over a picture would hide what differs.
    if (this.#other !== null) this.viewer.outline(false);
    await this.#show();
    const other = this.#other;
    if (other === null) return;
    setText(this.figures, "comparing …");
    const difference = await this.shell.attempt(() => get(`/jobs/${this.number}/difference/${other}`), this.element);
    if (this.#other === other) setText(this.figures, difference ? differenceText(difference) : "");
  }

  async #show() {
    const [other, mode] = [this.#other, this.mode.value];
    this.slider.hidden = mode !== "slider";
    if (other === null) return this.viewer.lay(null);
    const [kind, number] = other.split("-");
    const shown = kind === "job" ? `/jobs/${number}/preview.png` : `/pictures/${number}/shown.png`;
    const found = await fetchPicture(mode === "flip" ? `/jobs/${this.number}/difference/${other}/flip.png` : shown);
    if (this.#other !== other || this.mode.value !== mode) return undefined;
    this.viewer.lay(found?.blob ?? null, mode);
    this.#slide();
    return undefined;
  }

  #slide() { this.viewer.part(this.mode.value === "slider" ? Number(this.slider.value) : 0); }
}
