// Messages between agents: a recorded trace is read, filtered, and written in other forms.

import assert from "node:assert/strict";
import { test } from "node:test";
import { agentsOf, conversationHue, filtered, labelOf, laneNames, parseTrace, performativeWord, toMermaid, toText, valuesOf } from "../../assets/sequence.js";

const TRACE = [
  `  0.012345 master@here -> render-1@here,render-2@here CallForProposal fipa-contract-net #7 "Offers([Offer { zone: ZoneId(3), complexity: 1.5 }, Offer { zone: ZoneId(4), complexity: 2.0 }])"`,
  `  0.013000 render-1@here -> master@here AcceptProposal fipa-contract-net #7 "say \\"yes\\"\\nto ZoneId(3) \\u{e9}"`,
  `123.000000 ams@here -> render-1@here Inform fipa-request #18446744073709551615 "((done \\\\ x))"`,
  "this is no message", "",
].join("\n");

test("a trace is read line by line, and other lines are counted", () => {
  const { messages, strange } = parseTrace(TRACE);
  assert.deepEqual([messages.length, strange], [3, 1]);
  assert.deepEqual(messages[0].receivers, ["render-1@here", "render-2@here"]);
  assert.deepEqual([messages[0].performative, messages[0].zones, messages[0].at], ["cfp", [3, 4], 0.012345]);
  assert.equal(messages[1].content, "say \"yes\"\nto ZoneId(3) é");
  assert.deepEqual([messages[2].conversation, messages[2].content], ["18446744073709551615", "((done \\ x))"]);
  assert.deepEqual(parseTrace("\0\0binary"), { messages: [], strange: 1 });
});

test("performatives are written as the standard does", () => {
  assert.deepEqual(["CallForProposal", "AcceptProposal", "NotUnderstood", "InformIf", "Inform"].map(performativeWord),
    ["cfp", "accept-proposal", "not-understood", "inform-if", "inform"]);
});

test("messages are found by agent, protocol, performative and zone", () => {
  const { messages } = parseTrace(TRACE);
  const found = wanted => filtered(messages, wanted).map(message => messages.indexOf(message));
  assert.deepEqual(found({}), [0, 1, 2]);
  assert.deepEqual(found({ agent: "MASTER" }), [0, 1]);
  assert.deepEqual(found({ agent: "render-2" }), [0]);
  assert.deepEqual(found({ protocol: "fipa-request" }), [2]);
  assert.deepEqual(found({ performative: "cfp" }), [0]);
  assert.deepEqual(found({ zone: "4" }), [0]);
  assert.deepEqual(found({ zone: "0" }), []);
  assert.deepEqual(agentsOf(messages), ["master@here", "render-1@here", "render-2@here", "ams@here"]);
  assert.deepEqual(valuesOf(messages, "protocol"), ["fipa-contract-net", "fipa-request"]);
});

test("conversations have colors that are always the same, and differ", () => {
  const hues = new Set(Array.from({ length: 40 }, (_, i) => conversationHue(`${i}`)));
  assert.ok(hues.size > 30, `${hues.size}`);
  assert.equal(conversationHue("7"), conversationHue(7));
});

test("messages are written as text that is a trace again, and as Mermaid", () => {
  const { messages } = parseTrace(TRACE);
  assert.deepEqual(parseTrace(toText(messages)), { messages, strange: 0 });
  const mermaid = toMermaid(messages);
  assert.match(mermaid, /^sequenceDiagram\n {2}participant a1 as master@here\n/);
  assert.match(mermaid, /a1->>a2: cfp · zones 3, 4\n {2}a1->>a3: cfp/);
  // What is said cannot become more of the diagram.
  const evil = { at: 0, sender: "a\n  b->>c: x", receivers: ["d;%%"], performative: "inform", protocol: "", conversation: "1", content: "" };
  assert.equal(toMermaid([evil]).split("\n").length, 5);
  assert.ok(!toMermaid([evil]).includes("%%"));
  assert.equal(labelOf({ performative: "inform", zones: [1, 2, 3, 4] }), "inform · zones 1, 2, 3 …");
});

test("no two lanes are called the same", () => {
  const names = agents => agents.map(agent => laneNames(agents).get(agent)).map(({ name, place }) => `${name} ${place}`.trim());
  assert.deepEqual(names(["master@work-1", "render-1@oak.1f", "render-2@oak.1f", "render-1@elm.2c"]),
    ["master", "render-1 oak.1f", "render-2", "render-1 elm.2c"]);
  const host = "workstation-of-the-third-floor.example";
  assert.deepEqual(names([`df@${host}.aa01`, `df@${host}.bb02`]), ["df …aa01", "df …bb02"]);
  const long = [1, 2, 3].map(i => `df@${"a".repeat(30)}${i}${"z".repeat(30)}`);
  assert.equal(new Set(names([...long, "df@x", "df@x:1", "df"])).size, 6);
});
