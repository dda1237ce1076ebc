// The messages between the agents: of a job while they are said, or of a file that `bottega render --trace FILE` wrote.

import { get, isOnePicture } from "./api.js";
import { button, counted, element, setText } from "./format.js";
import { filtered, parseTrace, toMermaid, toText, valuesOf } from "./sequence.js";
import { drawing, SequenceView } from "./sequence_view.js";

const LOOK_EVERY = 1000;
/** Messages that are remembered of a job. */
const KEPT_MAX = 50_000;
/** Messages of an SVG file. */
const DRAWN_MAX = 2000;

const save = (text, name, kind) => {
  const link = element("a", { href: URL.createObjectURL(new Blob([text], { type: kind })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
};

/** A list to choose from, whose values come later. */
function chooser(label, help, any, onchange) {
  const select = element("select", { ariaLabel: label, title: help, onchange }, element("option", { value: "" }, any));
  select.offer = values => {
    const known = new Set([...select.options].map(option => option.value));
    values.filter(value => !known.has(value)).forEach(value => select.append(element("option", {}, value)));
  };
  return select;
}

export function showMessages(page, shell, number) {
  const view = new MessagesPage(page, shell, number);
  return () => view.close();
}

class MessagesPage {
  #messages = [];
  #next = 0;
  #isLooking = false;
  #isOver = false;
  #lost = 0;

  constructor(page, shell, number) {
    Object.assign(this, { shell, number });
    const show = () => this.#show();
    this.agent = element("input", { type: "search", placeholder: "Agent …", ariaLabel: "Filter by agent", oninput: show });
    this.protocol = chooser("Protocol", "Interaction protocol: the rules by which agents talk, such as an auction (contract net)", "All protocols", show);
    this.performative = chooser("Performative", "The communicative act of the message: request, propose, inform, refuse …", "All kinds", show);
    this.zone = element("input", { type: "number", min: 0, placeholder: "Zone", ariaLabel: "Filter by zone", oninput: show });
    this.follow = element("input", { type: "checkbox", checked: number !== undefined });
    this.count = element("p", { class: "quiet", role: "status" });
    this.panel = element("section", { class: "panel", "aria-live": "polite", "aria-label": "Message" });
    this.view = new SequenceView({ label: "Messages", onSelect: message => { this.follow.checked = false; this.#showMessage(message); } });
    this.chosen = element("input", { type: "file", class: "unseen", tabIndex: -1, ariaLabel: "Trace file", onchange: () => this.#read(this.chosen.files[0]) });
    this.split = element("div", { class: "split" }, this.view.element, this.panel);
    this.saves = [
      button("Save SVG", () => this.#saveDrawing(), { title: "The messages that are shown, as a drawing" }),
      button("Save text", () => save(toText(this.#wanted()), "messages.txt", "text/plain"), { title: "A line for each message that is shown" }),
      button("Save Mermaid", () => save(toMermaid(this.#wanted()), "messages.mmd", "text/plain"), { title: "A sequence diagram as text, for Mermaid" })];
    this.orders = element("div", { class: "row" }, this.saves,
      button("Open a trace …", () => this.chosen.click(), { title: "A file that bottega render --trace FILE wrote; or drop it here" }), this.chosen,
      number === undefined ? null : element("a", { class: "button", href: `#/job/${number}` }, isOnePicture() ? "Picture" : `Job ${number}`));
    const title = number === undefined || isOnePicture() ? "Messages" : `Messages of job ${number}`;
    page.replaceChildren(
      element("h1", {}, title),
      element("div", { class: "row filter" }, this.agent, this.protocol, this.performative, this.zone,
        number === undefined ? null : element("label", { title: "Keep the newest message in sight" }, this.follow, " Follow"), this.count),
      this.split, this.orders);
    this.page = page;
    this.drag = event => event.preventDefault();
    this.drop = event => { event.preventDefault(); this.#read(event.dataTransfer.files[0]); };
    page.addEventListener("dragover", this.drag);
    page.addEventListener("drop", this.drop);
    this.#showMessage(null);
    this.#show();
    if (number !== undefined) {
      this.timer = setInterval(() => this.#look(), LOOK_EVERY);
      this.#look();
    }
  }

  close() {
    clearInterval(this.timer);
    this.view.close();
    this.page.removeEventListener("dragover", this.drag);
    this.page.removeEventListener("drop", this.drop);
  }

  #wanted() {
    const { agent, protocol, performative, zone } = this;
    return filtered(this.#messages, { agent: agent.value, protocol: protocol.value, performative: performative.value, zone: zone.value });
  }

  #show() {
    const wanted = this.#wanted();
    this.protocol.offer(valuesOf(this.#messages, "protocol"));
    this.performative.offer(valuesOf(this.#messages, "performative"));
    // Where nothing was said there is nothing to look at or to save.
    for (const part of [this.split, ...this.saves]) part.hidden = !this.#messages.length;
    this.view.set(wanted, this.follow.checked);
    setText(this.count, this.#countText(wanted.length));
  }

  #countText(wanted) {
    const all = this.#messages.length;
    if (!all && this.number === undefined) return "Drop a trace here, or open one: bottega render … --trace FILE writes it.";
    if (!all && this.#isOver) return "No messages were recorded while it was painted: recording starts when this view is opened.";
    if (!all) return "No messages yet: they are recorded from now on.";
    const some = wanted === all ? counted(all, "message") : `${wanted} of ${counted(all, "message")}`;
    return this.#lost ? `${some}; ${this.#lost} were not recorded: too many at once` : some;
  }

  async #look() {
    if (this.#isLooking) return;
    this.#isLooking = true;
    try {
      const answer = await this.shell.poll(() => get(`/jobs/${this.number}/messages/${this.#next}`));
      if (!answer) return;
      const job = await this.shell.poll(() => get(`/jobs/${this.number}`));
      this.#isOver = Boolean(job) && !["active", "paused"].includes(job.state);
      this.#lost = answer.lost;
      this.#next = answer.first + answer.messages.length;
      if (answer.messages.length) this.#messages = [...this.#messages, ...answer.messages].slice(-KEPT_MAX);
      if (answer.messages.length || !this.#messages.length) this.#show();
    } finally {
      this.#isLooking = false;
    }
  }

  async #read(file) {
    if (!file) return;
    clearInterval(this.timer);
    const { messages, strange } = parseTrace(await file.text());
    this.shell.tellProblem(messages.length ? null : `${file.name} is not a trace: bottega render … --trace FILE writes one`, this.orders);
    if (!messages.length) return;
    this.#messages = messages;
    this.follow.checked = false;
    this.#showMessage(null);
    this.#show();
    setText(this.count, `${file.name}: ${counted(messages.length, "message")}${strange ? `; ${counted(strange, "line")} could not be read` : ""}`);
  }

  #saveDrawing() {
    const wanted = this.#wanted();
    save(new XMLSerializer().serializeToString(drawing(wanted.slice(0, DRAWN_MAX))), "messages.svg", "image/svg+xml");
    if (wanted.length > DRAWN_MAX) this.shell.tellProblem(`The drawing has the first ${DRAWN_MAX} messages: filter them for others.`, this.orders);
  }

  #showMessage(message) {
    if (!message) {
      this.panel.replaceChildren(element("h2", {}, "Message"), element("p", { class: "quiet" }, "Click an arrow, or use the arrow keys."));
      return;
    }
    const fields = [
      ["Kind", message.performative, "Performative: the communicative act of the message"],
      ["From", message.sender], ["To", message.receivers.join(", ")],
      ["At", `${message.at.toFixed(3)} s`, "Seconds since the work began where it was seen"],
      ["Protocol", message.protocol, "The interaction protocol that it is part of"],
      ["Conversation", message.conversation, "Messages with one number belong together, and have one color"],
      ["Zones", (message.zones ?? []).join(", ") || "–", "The zones of the picture that it is about"],
    ].map(([name, value, help]) => [element("dt", { title: help ?? "" }, name), element("dd", {}, value)]);
    this.panel.replaceChildren(element("h2", {}, "Message"), element("dl", {}, fields), element("pre", { tabIndex: 0, ariaLabel: "Content" }, message.content));
  }
}
