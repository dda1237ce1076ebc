// Messages between agents as a sequence: read, filtered, and written as text and as Mermaid. Knows nothing of the page.

/** A line of a file that `render --trace` wrote: time, sender, receivers, performative, protocol, conversation, content. */
const TRACE_LINE = /^\s*(\d+\.\d+) (\S+) -> (\S*) ([\w-]+) (\S*) #(\d+) (".*")$/;
const NUMBERED_MAX = 2000;

/** `AcceptProposal` as the standard writes it: `accept-proposal`. */
export function performativeWord(name) {
  if (name === "CallForProposal") return "cfp";
  return name.replace(/(?<=[a-z])[A-Z]/g, letter => `-${letter}`).toLowerCase();
}

/** A text as Rust's `{:?}` writes it. */
function unquoted(text) {
  const escapes = { n: "\n", r: "\r", t: "\t", 0: "\0" };
  return text.slice(1, -1).replace(/\\(?:u\{([0-9a-f]+)\}|u([0-9a-f]{4})|(.))/g, (_, rust, json, letter) =>
    (rust ?? json ? String.fromCodePoint(Number.parseInt(rust ?? json, 16)) : escapes[letter] ?? letter));
}

/** The zones that a content speaks of, by its text. */
export function zonesOf(content) {
  return [...new Set([...content.matchAll(/ZoneId\((\d+)\)/g)].map(([, zone]) => Number(zone)))];
}

/** The messages of a recorded trace, and the number of other lines. */
export function parseTrace(text) {
  let strange = 0;
  const messages = [];
  for (const line of text.split("\n")) {
    if (!line.trim()) continue;
    const found = TRACE_LINE.exec(line);
    if (!found) {
      strange++;
      continue;
    }
    const [, at, sender, receivers, performative, protocol, conversation, quoted] = found;
    const content = unquoted(quoted);
    messages.push({
      at: Number(at), sender, receivers: receivers.split(",").filter(Boolean), performative: performativeWord(performative), protocol, conversation, content,
      zones: zonesOf(content),
    });
  }
  return { messages, strange };
}

/** The hue of a conversation: those that follow each other differ. */
export function conversationHue(conversation) {
  let hash = 0;
  for (const letter of String(conversation)) hash = (hash * 31 + letter.charCodeAt(0)) % 100_003;
  return Math.round((hash * 137.508) % 360);
}

/** The messages that are wanted: of an agent (a part of its name), a protocol, a performative, a zone. What is empty is any. */
export function filtered(messages, { agent = "", protocol = "", performative = "", zone = "" }) {
  const name = agent.trim().toLowerCase();
  const number = zone === "" ? null : Number(zone);
  return messages.filter(message => (!name || [message.sender, ...message.receivers].some(it => it.toLowerCase().includes(name)))
    && (!protocol || message.protocol === protocol) && (!performative || message.performative === performative)
    && (number === null || (message.zones ?? []).includes(number)));
}

/** The agents in the order in which they are first seen. */
export function agentsOf(messages) {
  const agents = new Set();
  for (const { sender, receivers } of messages) {
    agents.add(sender);
    receivers.forEach(receiver => agents.add(receiver));
  }
  return [...agents];
}

/** Each value of a field, sorted. */
export const valuesOf = (messages, field) => [...new Set(messages.map(message => message[field]))].filter(Boolean).sort();

/** Letters of a place at most, as a lane has it. */
const PLACE_MAX = 18;

/**
 * What the lanes of agents are called: `{ name, place }` by agent. The place is that behind the `@`; only agents of one name have it,
 * so that no two lanes are called the same. What such places begin with in common is left out where they are long.
 */
export function laneNames(agents) {
  const byName = new Map();
  for (const agent of agents) {
    const [name] = agent.split("@");
    byName.set(name, [...byName.get(name) ?? [], agent]);
  }
  const names = new Map();
  for (const [name, group] of byName) {
    const places = group.map(agent => agent.slice(name.length + 1));
    const taken = new Map();
    group.forEach((agent, i) => {
      const place = group.length > 1 ? shortPlace(places[i], places) : "";
      const before = taken.get(place) ?? 0;
      taken.set(place, before + 1);
      names.set(agent, { name, place: before ? `${place} (${before + 1})` : place });
    });
  }
  return names;
}

/** A place as it differs from others. */
function shortPlace(place, all) {
  if (place.length <= PLACE_MAX) return place;
  let shared = 0;
  while (shared < place.length && all.every(other => other[shared] === place[shared])) shared++;
  // From the word on in which they differ.
  const begin = Math.max(0, ...[".", "-", "_", "/", ":"].map(mark => place.lastIndexOf(mark, shared - 1) + 1));
  const rest = begin ? `…${place.slice(begin)}` : place;
  return rest.length <= PLACE_MAX ? rest : `${rest.slice(0, PLACE_MAX / 2)}…${rest.slice(1 - PLACE_MAX / 2)}`;
}

/** What stands at an arrow. */
export function labelOf({ performative, zones = [] }) {
  if (!zones.length) return performative;
  return `${performative} · zone${zones.length > 1 ? "s" : ""} ${zones.length > 3 ? `${zones.slice(0, 3).join(", ")} …` : zones.join(", ")}`;
}

/** The messages as text, a line each. */
export function toText(messages) {
  const line = ({ at, sender, receivers, performative, protocol, conversation, content }) =>
    `${at.toFixed(6).padStart(10)} ${sender} -> ${receivers.join(",")} ${performative} ${protocol} #${conversation} ${JSON.stringify(content)}\n`;
  return messages.map(line).join("");
}

/** A text that Mermaid takes as it is. */
const plain = text => text.replace(/[^\p{L}\p{N} .,·…@_()-]/gu, " ");

/** The messages as a sequence diagram of Mermaid; of many the first ones. */
export function toMermaid(messages) {
  const agents = agentsOf(messages.slice(0, NUMBERED_MAX));
  const ids = new Map(agents.map((agent, i) => [agent, `a${i + 1}`]));
  const lines = ["sequenceDiagram", ...agents.map(agent => `  participant ${ids.get(agent)} as ${plain(agent)}`)];
  for (const message of messages.slice(0, NUMBERED_MAX)) {
    for (const receiver of message.receivers) {
      lines.push(`  ${ids.get(message.sender)}->>${ids.get(receiver)}: ${plain(labelOf(message))}`);
    }
  }
  if (messages.length > NUMBERED_MAX) lines.push(`  %% and ${messages.length - NUMBERED_MAX} messages more`);
  return `${lines.join("\n")}\n`;
}
