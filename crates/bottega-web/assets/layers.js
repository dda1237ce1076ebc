// The layers of a picture that is done, chosen to be looked at.

import { fetchPicture, get } from "./api.js";
import { element } from "./format.js";

/** A choice of layers for a viewer; `onColor` is called when the picture itself is wanted again. */
export class LayerChoice {
  #of = null;

  constructor(shell, viewer, number, onColor) {
    Object.assign(this, { shell, viewer, number, onColor });
    this.select = element("select", { ariaLabel: "Layer", onchange: () => this.#show() }, element("option", { value: "" }, "color"));
    this.file = element("a", { download: "", class: "button", hidden: true }, "Download this layer");
    this.element = element("span", { class: "group", hidden: true }, element("label", {}, "Layer ", this.select), this.file);
  }

  /** Whether a layer is shown in place of the picture. */
  get isOn() { return this.select.value !== ""; }

  /** Offers the layers of a job whose picture there is. */
  async set(job) {
    const key = `${job.kept} ${job.state}`;
    if (key === this.#of) return;
    this.#of = key;
    const layers = job.kept && job.output.endsWith(".exr") ? await this.shell.poll(() => get(`/jobs/${this.number}/layers`)) : [];
    if (!layers) {
      this.#of = null;
      return;
    }
    this.select.replaceChildren(element("option", { value: "" }, "color"), ...layers.map(({ name }) => element("option", { value: name }, name)));
    this.element.hidden = layers.length === 0;
    this.file.hidden = true;
  }

  async #show() {
    const layer = this.select.value;
    this.file.hidden = !layer;
    if (!layer) return this.onColor();
    const path = `/jobs/${this.number}/layers/${encodeURIComponent(layer)}`;
    this.file.href = `/api${path}.exr`;
    const found = await fetchPicture(`${path}.png`);
    if (found && this.select.value === layer) await this.viewer.show(found.blob);
    return undefined;
  }
}
