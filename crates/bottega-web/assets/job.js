// One job: the picture while it is painted, its zones over it, the Blackboard, agents, log.

import { agentRows, agentTable, auctionLine } from "./agents.js";
import { ask, fetchPicture, follow, get, isOnePicture, maySteer } from "./api.js";
import { blackboard, zonePanel } from "./blackboard.js";
import { Comparison } from "./compare.js";
import { energyFacts, usedText } from "./energy.js";
import { ago, button, element, setText, time } from "./format.js";
import { FrameStrip } from "./frames.js";
import { JobControls, progress, stateChip } from "./job_controls.js";
import { LayerChoice } from "./layers.js";
import { LookAround, viewSize } from "./lookaround.js";
import { RulesSection } from "./rules.js";
import { Viewer } from "./viewer.js";
import { workOf } from "./zones.js";

const LOOK_EVERY = 1000;
/** Agents and log are fetched once in this number of looks. */
const SELDOM = 3;

export function showJob(page, shell, number) {
  const view = new JobPage(page, shell, number);
  return () => view.close();
}

class JobPage {
  #zones = new Map();
  #agents = new Map();
  #job = null;
  #selected = null;
  #tag = null;
  #shown = null;
  #energy = null;
  #looks = 0;
  #isLooking = false;
  /** Whether some pixels have samples. */
  #isPainted = false;
  /** Whether the farm has reported that there is something to see. */
  #isSeen = false;

  constructor(page, shell, number) {
    Object.assign(this, { shell, number });
    this.title = element("h1", {}, `Job ${number}`);
    this.chip = stateChip();
    this.bar = progress();
    this.facts = element("dl", { class: "facts" });
    this.reason = element("p", { class: "reason", hidden: true });
    this.controls = new JobControls(shell, { onGone: () => { location.hash = "#/"; } });
    this.links = element("div", { class: "row links" });
    this.around = null;
    this.aroundPlace = element("div");
    this.viewer = new Viewer({ label: `Picture of job ${number}`, onPick: zone => this.#select(zone) });
    if (!isOnePicture()) this.#addImportance();
    this.layers = new LayerChoice(shell, this.viewer, number, () => { [this.#tag, this.#shown] = [null, null]; this.#look(); });
    this.viewer.extras.after(this.layers.element);
    this.comparison = new Comparison(shell, this.viewer, number);
    this.viewer.element.append(this.comparison.element);
    this.frames = new FrameStrip(shell);
    this.panel = element("section", { class: "panel", "aria-live": "polite", "aria-label": "Zone" });
    this.zoneOrders = element("div", { class: "row" });
    this.board = blackboard(zone => this.#select(zone));
    this.rules = new RulesSection(shell, number);
    this.agentTable = agentTable();
    this.auction = element("p", { class: "quiet" });
    this.log = element("ol", { class: "log" });
    page.replaceChildren(
      element("div", { class: "job-head" }, element("div", { class: "row" }, this.title, this.chip), this.bar, this.facts, this.reason,
        element("div", { class: "row" }, this.controls.element, this.links), this.frames.element, this.aroundPlace),
      element("div", { class: "split" }, this.viewer.element, this.panel),
      element("h2", {}, "Blackboard"), this.board.element,
      // Of the picture of one process neither rules nor auction are known here.
      ...(isOnePicture() ? [] : [this.rules.element]),
      element("h2", {}, "Agents"), ...(isOnePicture() ? [] : [this.auction]), this.agentTable.element,
      element("h2", {}, "Log"), this.log);
    this.board.element.classList.add("tall");
    this.#select(null);
    this.#follow();
    this.timer = setInterval(() => this.#look(), LOOK_EVERY);
    this.#look();
  }

  #follow() {
    this.end?.();
    this.end = follow(this.number, {
      link: isUp => this.shell.link(isUp),
      state: events => { this.#zones.clear(); this.#agents.clear(); this.#take(events); },
      changes: events => this.#take(events),
    });
  }

  close() {
    this.end();
    clearInterval(this.timer);
    this.around?.close();
    [this.viewer, this.board, this.agentTable].forEach(part => part.close());
  }

  #take(events) {
    const take = {
      job: event => this.#takeJob(event),
      zone: event => this.#zones.set(event.id, event),
      agent: event => this.#agents.set(event.agent, event),
      removed: () => {
        setText(this.title, `Job ${this.number} was removed`);
        this.controls.element.hidden = this.links.hidden = true;
        clearInterval(this.timer);
        this.end();
      },
    };
    for (const event of events) take[event.event]?.(event);
    if (events.some(event => event.event === "note" || event.event === "warning")) this.#looks = 0;
    if (!events.some(event => event.event === "zone")) return;
    const zones = [...this.#zones.values()];
    // The first pixels are not waited for.
    const isSeen = this.#isPainted;
    this.#isPainted = zones.some(zone => zone.samples > 0);
    if (this.#isPainted && !isSeen) this.#look();
    this.viewer.setZones(zones);
    this.board.set(zones);
    this.#showAgents();
    if (this.#selected !== null) this.#showZone(this.#zones.get(this.#selected) ?? null);
  }

  #takeJob(job) {
    // Who opens a picture that is done wants to see it.
    if (!this.#job && job.state === "done") this.viewer.outline(false);
    this.#job = job;
    setText(this.title, isOnePicture() ? job.scene || "The picture" : `Job ${job.job}: ${job.scene}`);
    if (job.seen && !this.#isSeen) setTimeout(() => this.#look());
    this.#isSeen = job.seen;
    this.chip.set(job.state);
    this.bar.set(job.done, isOnePicture() ? "the picture" : `job ${job.job}`);
    this.reason.hidden = !job.reason;
    setText(this.reason, job.reason ?? "");
    this.controls.set(job);
    this.layers.set(job);
    this.comparison.element.hidden = !job.kept;
    this.frames.set(job);
    this.#showFacts();
    this.#showLinks();
  }

  #showFacts() {
    const job = this.#job;
    if (!job) return;
    const left = job.seconds_left ?? null;
    const isOver = !["active", "paused"].includes(job.state);
    const facts = [
      ["Zones", job.zones ? `${job.zones_done} of ${job.zones}` : "not cut yet"],
      job.state === "active" ? ["Time left", left === null ? "not known yet" : `about ${time(left)}`] : null,
      ...(isOnePicture() ? [["Begun", ago(job.submitted)]] : [
        isOver ? null : ["Machines", `${job.machines}`],
        isOver ? null : ["Led by", job.leader ?? "nobody"],
        ["Submitted", `${ago(job.submitted)}, by ${job.from}`],
      ]),
      ["Picture", job.output],
      ...energyFacts(this.#energy),
    ].filter(Boolean);
    if (this.facts.childElementCount !== facts.length) {
      this.facts.replaceChildren(...facts.map(() => element("div", {}, element("dt"), element("dd"))));
    }
    facts.forEach(([name, value, help], i) => {
      this.facts.children[i].title = help ?? "";
      setText(this.facts.children[i].firstChild, name);
      setText(this.facts.children[i].lastChild, value);
    });
  }

  #showLinks() {
    const { kept, output, state } = this.#job;
    const key = `${kept} ${state}`;
    if (this.links.dataset.key === key) return;
    this.links.dataset.key = key;
    const file = kept ? element("a", { href: `/api/jobs/${this.number}/picture`, download: "", class: "button" }, `Download ${output}`) : null;
    const again = isOnePicture()
      ? button("Look around …", () => this.#lookAround(), { title: "Lead a camera through the scene while the picture is painted" })
      : element("a", { href: `#/submit/${this.number}`, class: "button steers" }, "Paint this scene again …");
    const help = "The messages of its agents, live";
    const messages = element("a", { href: `#/messages/${this.number}`, class: "button", title: help }, "Messages");
    this.links.replaceChildren(...[file, button("Save what is shown", () => this.#save()), messages, again].filter(Boolean));
  }

  /** Shows the scene of the only picture, so that a camera can be led through it. */
  async #lookAround() {
    this.around?.close();
    const { picture } = this.viewer;
    const size = picture.naturalWidth ? { film: { size: viewSize([picture.naturalWidth, picture.naturalHeight]) } } : {};
    const around = this.around = new LookAround(this.shell, null);
    const opened = await this.shell.attempt(async () => { await around.open({ request: size, files_of_job: this.number }); return true; }, this.links);
    if (!opened || this.around !== around) around.close();
    else this.aroundPlace.replaceChildren(around.element);
  }

  #save() {
    const { src } = this.viewer.picture;
    if (src) element("a", { href: src, download: `job-${this.number}.png` }).click();
    else this.shell.tellProblem("Nothing is painted yet.", this.links);
  }

  #addImportance() {
    const state = element("span", { class: "quiet", role: "status" });
    const box = element("input", { type: "checkbox", onchange: async () => {
      const map = box.checked ? await fetchPicture(`/jobs/${this.number}/importance.png`) : null;
      setText(state, box.checked && !map ? ` not known of this ${isOnePicture() ? "picture" : "job"}` : "");
      if (!map) box.checked = false;
      this.viewer.showImportance(map?.blob ?? null);
    } });
    const help = "The importance map over the picture: what each pixel is predicted to cost";
    this.viewer.extras.append(element("label", { title: help }, box, " Importance"), state);
  }

  #select(zone) {
    this.#selected = zone?.id ?? null;
    this.viewer.select(zone);
    this.board.select(this.#selected);
    this.rules.choose(zone);
    this.#showZone(zone);
  }

  #showZone(zone) {
    const used = zone && this.#energy?.zones?.find(({ id }) => id === zone.id);
    const parts = zonePanel(zone, used && usedText(used, this.#energy.currency)).filter(Boolean);
    const isSettled = zone && ["done", "failed"].includes(zone.state) && maySteer && !isOnePicture();
    // A button that is pressed, and what it was answered, stay while the zone changes.
    const key = `${zone?.id} ${isSettled}`;
    if (this.zoneOrders.dataset.key !== key) {
      this.zoneOrders.dataset.key = key;
      const help = "The zone is open again, and the agent that wins it paints it";
      this.zoneOrders.replaceChildren(...(isSettled ? [button("Paint it again", () => this.#requeue(zone), { class: "steers", title: help })] : []));
    }
    if (isSettled) parts.splice(1, 0, this.zoneOrders);
    this.panel.replaceChildren(...parts);
  }

  /** Has a zone painted again. Of a job that is over the farm keeps no zones: all of them are. */
  async #requeue(zone) {
    const isOver = this.#job && !["active", "paused"].includes(this.#job.state);
    const text = `Paint zone ${zone.id} again? The job is over and its zones are not stored, so all zones are painted again.`;
    if (isOver && !await this.shell.confirm(text, "Paint again")) return;
    const job = await this.shell.attempt(() => ask("POST", `/jobs/${this.number}/zones/${zone.id}/requeue`), this.zoneOrders);
    if (!job || !isOver) return;
    [this.#shown, this.#looks] = [null, 0];
    this.#follow();
  }

  #showAgents() {
    const zones = [...this.#zones.values()];
    this.agentTable.set(agentRows([...this.#agents.values()], this.viewer.hues, workOf(zones)));
  }

  async #look() {
    if (this.#isLooking) return;
    this.#isLooking = true;
    try {
      this.#showFacts();
      await this.#lookAtPicture();
      if (this.#looks++ % SELDOM === 0) await this.#lookAtPeople();
    } finally {
      this.#isLooking = false;
    }
  }

  async #lookAtPicture() {
    const job = this.#job;
    // Until something is painted there is no picture; one that is over does not change.
    if (!job || this.layers.isOn || (!job.zones_done && !job.kept && !this.#isPainted && !job.seen) || (this.#shown === job.state && job.state !== "active")) return;
    const { state } = job;
    const isPainted = !["active", "paused"].includes(state) ? job.kept : true;
    const found = isPainted ? await fetchPicture(`/jobs/${this.number}/preview.png`, this.#tag) : null;
    if (found) {
      this.#tag = found.tag;
      await this.viewer.show(found.blob);
    }
    this.#shown = state;
  }

  async #lookAtPeople() {
    const isOver = this.#job && !["active", "paused"].includes(this.#job.state);
    if (isOver && this.#looks > SELDOM * 2) return;
    const people = await this.shell.poll(() => get(`/jobs/${this.number}/agents`));
    if (!people) return;
    for (const agent of people.agents) this.#agents.set(agent.agent, agent);
    setText(this.auction, auctionLine(people.auction));
    this.#showAgents();
    this.#energy = await this.shell.poll(() => get(`/jobs/${this.number}/energy`)) ?? this.#energy;
    const log = await this.shell.poll(() => get(`/jobs/${this.number}/log`));
    if (!log || log.length === this.log.childElementCount) return;
    const line = ({ at, text }) => element("li", {},
      element("time", { dateTime: new Date(1000 * at).toISOString() }, new Date(1000 * at).toLocaleTimeString()), ` ${text}`);
    this.log.replaceChildren(...log.map(line).reverse());
  }
}
