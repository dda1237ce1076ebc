// The page in a real browser, of a real farm: a job is submitted by the form and watched to its end, every view is opened, every
// button pressed. What the pages looked like lies in `target/pictures`.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { zip } from "../archive.js";
import { barriers, keep, openPage } from "./browser.js";
import { until } from "./farm.js";
import { SCENE, JOB_WAIT, browser, chip, farm, go, noProblems, number, page, press, test } from "./story.js";

const EXR_MAGIC = 20000630;

/** Submits the chosen scene, and waits for the view of the job. */
async function paint() {
  await press("Paint it");
  await page.waitForURL(/#\/job\/\d+$/, JOB_WAIT);
  return number();
}

test("the token leaves the address, and an empty farm says what to do", async () => {
  assert.equal(new URL(page.url()).search, "");
  await page.getByText("No jobs yet").waitFor();
  assert.deepEqual(await barriers(page), []);
  noProblems();
});

test("a form with something wrong in it says where, and is not sent", async () => {
  await page.getByRole("link", { name: "New picture" }).click();
  await page.getByRole("heading", { name: "New picture" }).waitFor();
  await press("Paint it");
  await page.getByRole("alert").getByText("Choose a scene first").waitFor();
  const chooser = page.waitForEvent("filechooser");
  await page.locator("button", { hasText: "Choose files …" }).click();
  // A damaged archive is reported; a whole one is as good as its files.
  const archive = Buffer.from(await zip([["cornell-box.glb", readFileSync(SCENE)]]).arrayBuffer());
  await (await chooser).setFiles({ name: "torn.zip", mimeType: "application/zip", buffer: archive.subarray(0, 999) });
  await page.getByRole("alert").getByText("not a complete zip archive").waitFor();
  await page.locator("input[type=file]").first().setInputFiles({ name: "box.zip", mimeType: "application/zip", buffer: archive });
  await page.locator("ul.files").getByText("cornell-box.glb").waitFor();
  await page.getByLabel("Width and height").fill("abc, 120");
  await press("Paint it");
  assert.equal(await page.getByLabel("Width and height").getAttribute("aria-invalid"), "true");
  await page.getByLabel("Width and height").fill("160 x 120");
  // What only the farm knows to be wrong is shown at its field, too.
  await page.getByLabel("Samples per pixel").fill("0");
  await press("Paint it");
  await page.locator(".field .wrong").getByText("goal.samples").waitFor();
  assert.equal(await page.getByLabel("Samples per pixel").getAttribute("aria-invalid"), "true");
  await keep(page, "submit-wrong");
  assert.deepEqual(await barriers(page), []);
  const problems = page.problems.splice(0).filter(text => !text.includes("422"));
  assert.deepEqual(problems, []);
});

test("every section of the form opens and has no barrier", async () => {
  for (const summary of await page.locator("details > summary").all()) await summary.click();
  await keep(page, "submit-open");
  assert.deepEqual(await barriers(page), []);
  assert.match(await page.locator("pre").textContent(), /"size": \[\s*160,\s*120\s*\]/);
  noProblems();
});

test("a job is submitted by the form and watched to its end", async () => {
  await page.getByLabel("Samples per pixel").fill("64");
  const submitted = Date.now();
  const job = await paint();
  await page.locator(".stage img.picture[src]").waitFor(JOB_WAIT);
  console.log(`first pixels ${((Date.now() - submitted) / 1000).toFixed(1)} s after “Paint it” (upload, reading the scene, painting)`);
  await keep(page, "job-painting");
  await chip("done").waitFor(JOB_WAIT);
  await until("all zones are shown as done", async () => (await page.locator("dd").first().textContent()).match(/^(\d+) of \1$/));
  assert.equal((await farm.ask(`/jobs/${job}`)).state, "done");
  // The image is the picture: its size is the requested one.
  const size = await until("the last picture", () => page.locator("img.picture").evaluate(it => [it.naturalWidth, it.naturalHeight]));
  assert.deepEqual(size, [160, 120]);
  noProblems();
});

test("the picture zooms, is exposed, and shows its zones by everything that is known of them", async () => {
  const scale = () => page.locator(".scale").textContent();
  const fitted = await scale();
  await press("Zoom in");
  await until("it is larger", async () => (await scale()) !== fitted);
  await press("1:1");
  await until("one to one", async () => (await scale()) === "100 %");
  await press("Zoom out");
  await press("Fit");
  await until("it fits", async () => (await scale()) === fitted);
  await page.locator(".stage").hover();
  await page.mouse.wheel(0, -300);
  await until("the wheel zooms", async () => (await scale()) !== fitted);
  await page.locator(".stage").press("0");
  await until("the key 0 fits", async () => (await scale()) === fitted);
  await page.locator(".stage").press("+");
  await page.locator(".stage").press("ArrowLeft");
  await page.locator(".stage").press("0");
  await page.getByLabel("Exposure").fill("2");
  assert.match(await page.locator("img.picture").getAttribute("style"), /exposure/);
  await page.getByLabel("Exposure").fill("0");
  await page.getByLabel("Zones", { exact: true }).check();
  const drawing = () => page.locator("canvas.zones").evaluate(canvas => canvas.toDataURL());
  const drawings = new Set();
  for (const coloring of ["agent", "state", "expected", "measured", "promise"]) {
    await page.getByLabel("Color by").selectOption(coloring);
    await page.waitForTimeout(100);
    drawings.add(await drawing());
  }
  assert.ok(drawings.size >= 4, `${drawings.size} drawings of 5 colorings differ`);
  await page.getByLabel("Importance").check().catch(() => {});
  await page.waitForTimeout(300);
  await keep(page, "job-zones");
  noProblems();
});

test("a zone that is clicked is shown with all that is known, and marked on the Blackboard", async () => {
  await page.locator(".stage").click({ position: { x: 300, y: 200 } });
  const title = await page.locator(".panel h2").textContent();
  assert.match(title, /^Zone \d+$/);
  assert.match(await page.locator(".panel").textContent(), /Bounces of light.*Measured time|Measured time.*Bounces of light/s);
  const marked = page.getByRole("table", { name: "Blackboard" }).locator("tr[aria-current]");
  assert.equal(`Zone ${await marked.locator("td").first().textContent()}`, title);
  const board = page.getByRole("region", { name: "Blackboard, scrolls" });
  await board.press("Home");
  const first = await page.locator(".panel h2").textContent();
  await board.press("ArrowDown");
  assert.notEqual(await page.locator(".panel h2").textContent(), first, "the arrow keys choose another zone");
  for (const name of ["Blackboard", "Agents"]) {
    for (const head of await page.getByRole("table", { name }).locator("thead th:not([hidden]) button").all()) await head.click();
  }
  await page.getByRole("table", { name: "Blackboard" }).getByRole("button", { name: "Measured" }).click();
  await until("sorted by time", async () => {
    const cells = await page.getByRole("table", { name: "Blackboard" }).locator("tbody tr:not(.spacer) td:nth-child(5)").allTextContents();
    const times = cells.slice(0, 5).map(text => Number.parseFloat(text) * (text.endsWith("ms") ? 0.001 : 1));
    return times.join() === [...times].sort((a, b) => b - a).join();
  });
  // A single agent has nobody to compete with, so there is no auction.
  const agents = await page.getByRole("table", { name: "Agents" }).locator("tbody tr:not(.spacer)").count();
  assert.equal(await page.locator("p", { hasText: /\d+ rounds/ }).count(), agents > 1 ? 1 : 0, `${agents} agents`);
  assert.ok(await page.locator(".log li").count() >= 2);
  assert.deepEqual(await barriers(page), []);
  noProblems();
});

test("the picture is downloaded, as requested and as it is shown", async () => {
  const download = async click => {
    const waiting = page.waitForEvent("download");
    await click();
    const file = await waiting;
    return [file.suggestedFilename(), readFileSync(await file.path())];
  };
  const [name, exr] = await download(() => page.getByRole("link", { name: /^Download/ }).click());
  assert.equal(name, "cornell-box.exr");
  assert.equal(exr.readUInt32LE(0), EXR_MAGIC);
  const [, png] = await download(() => press("Save what is shown"));
  assert.equal(png.subarray(1, 4).toString(), "PNG");
  noProblems();
});

test("energy and cost of a job, a machine and a zone are shown", async () => {
  const facts = page.locator(".facts");
  await facts.getByText(/Wh, 0\.\d+ EUR/).waitFor(JOB_WAIT);
  await page.getByRole("region", { name: "Blackboard, scrolls" }).press("Home");
  await page.locator(".panel dl").getByText(/Wh, 0\.\d+ EUR/).waitFor(JOB_WAIT);
  const energy = await farm.ask(`/jobs/${number()}/energy`);
  assert.equal(energy.machines[0].source, "watts");
  assert.ok(energy.zones.length > 0 && energy.cost > 0, JSON.stringify(energy));
  noProblems();
});

test("the rules are drawn, and say that nobody asks them where optimization is off", async () => {
  await page.locator(".rules > summary").click();
  await page.getByText("Optimization is off").waitFor(JOB_WAIT);
  assert.ok(await page.locator(".membership").count() >= 3);
  await keep(page, "job-rules-off");
  assert.deepEqual(await barriers(page), []);
  noProblems();
});

// The page may have been asking about a job while it was being removed; the answer may be late.
let removed = null;
const isOfRemoved = it => it.includes("404") && it.includes(`/api/jobs/${removed}`);

test("a job is painted again from the farm's files, steered by every button, and removed", async () => {
  await page.getByRole("link", { name: "Paint this scene again …" }).click();
  await page.getByText("which are in the farm").waitFor();
  await page.getByLabel("Samples per pixel").fill("100000");
  const job = await paint();
  const state = async () => (await farm.ask(`/jobs/${job}`)).state;
  await press(`Pause job ${job}`);
  await chip("paused").waitFor(JOB_WAIT);
  assert.equal(await state(), "paused");
  await press(`Resume job ${job}`);
  await chip("active").waitFor(JOB_WAIT);
  await page.getByLabel("Priority").fill("30");
  await page.getByLabel("Priority").press("Enter");
  await until("its priority is 30", async () => (await farm.ask(`/jobs/${job}`)).priority === 30);
  await press(`Cancel job ${job}`);
  await page.getByRole("dialog").getByRole("button", { name: "Back" }).click();
  assert.equal(await state(), "active", "who goes back has cancelled nothing");
  await press(`Cancel job ${job}`);
  await page.getByRole("dialog").getByRole("button", { name: "Cancel the job" }).click();
  await chip("cancelled").waitFor(JOB_WAIT);
  await press(`Remove job ${job}`);
  await page.getByRole("dialog").getByRole("button", { name: "Remove" }).click();
  await page.waitForURL(/#\/$/);
  await until("the farm forgot it", async () => (await farm.ask("/jobs")).every(it => it.job !== job));
  removed = job;
  noProblems(isOfRemoved);
});

test("the list of jobs has pictures, and is filtered and ordered", async () => {
  await go("");
  await page.locator(".thumb img[src]").first().waitFor(JOB_WAIT);
  await page.getByLabel("Filter jobs").fill("no such scene");
  await page.getByText("No job matches").waitFor();
  await page.getByLabel("Filter jobs").fill("cornell");
  await page.getByLabel("State").selectOption("done");
  for (const order of ["priority", "progress", "newest"]) await page.getByLabel("Order").selectOption(order);
  assert.equal(await page.locator(".jobs li").count(), 1);
  assert.deepEqual(await barriers(page), []);
  noProblems(isOfRemoved);
});

test("with optimization the rules that fire for a zone and the messages of the agents are shown", async () => {
  const request = {
    scene: { file: "cornell-box.glb" }, film: { size: [160, 120] }, goal: { samples: 600 },
    work: { optimization: "n", zones: 40 }, output: { file: "rules.exr" },
  };
  const { job } = await farm.post("/jobs", { request, files_of_job: 1 });
  await go(`messages/${job}`);
  await page.locator(".arrows text").first().waitFor(JOB_WAIT);
  const count = async () => Number((await page.locator(".filter p").textContent()).match(/(\d+) message/)?.[1] ?? 0);
  await until("more are seen", async () => await count() > 50);
  await page.locator(".sequence").press("Home");
  await page.locator(".sequence").press("ArrowDown");
  assert.match(await page.locator(".panel").textContent(), /Kind.*From.*Protocol/s);
  await page.locator(".messages-space").click({ position: { x: 90, y: 200 } });
  await keep(page, "messages");
  assert.deepEqual(await barriers(page), []);
  await page.getByLabel("Performative").selectOption("cfp");
  await until("only calls for proposals", async () => (await page.locator(".arrows text").allTextContents()).every(text => text.startsWith("cfp")));
  await page.getByLabel("Performative").selectOption("");
  await page.getByLabel("Filter by zone").fill("3");
  await page.getByLabel("Filter by zone").fill("");
  await page.getByLabel("Filter by agent").fill("nobody at all");
  await until("none", async () => await page.locator(".arrows text").count() === 0);
  await page.getByLabel("Filter by agent").fill("");
  const saved = async name => {
    const waiting = page.waitForEvent("download");
    await press(name);
    return readFileSync(await (await waiting).path(), "utf8");
  };
  assert.match(await saved("Save SVG"), /^<svg .*<\/svg>$/s);
  assert.match(await saved("Save text"), /master@work-\d+/);
  assert.match(await saved("Save Mermaid"), /^sequenceDiagram/);
  await go(`job/${job}`);
  await chip("done").waitFor({ timeout: 300_000 });
  await page.locator(".rules > summary").click();
  await page.getByText("Choose a zone").waitFor(JOB_WAIT);
  await page.locator(".stage").click({ position: { x: 300, y: 200 } });
  await page.locator(".fired meter").first().waitFor(JOB_WAIT);
  assert.match(await page.locator(".rules").textContent(), /its agent applied path_tracing: .*IF .* THEN /s);
  assert.ok(await page.locator(".membership .mark").count() >= 3);
  await keep(page, "job-rules");
  assert.deepEqual(await barriers(page), []);
  await page.locator(".rules details > summary").click();
  noProblems();
});

test("a recorded trace is opened, and ten thousand messages stay at hand", async () => {
  await go("messages");
  await page.getByText("Drop a trace here").waitFor();
  assert.ok(await page.locator(".sequence").isHidden(), "there is nothing to look at");
  const line = i => `${(i / 1000).toFixed(6)} master@here -> render-${1 + (i % 6)}@here CallForProposal fipa-contract-net #${i % 50} "Offers([Offer { zone: ZoneId(${i % 90}) }])"`;
  const trace = Array.from({ length: 10_000 }, (_, i) => line(i)).join("\n");
  await page.getByLabel("Trace file").setInputFiles({ name: "trace.txt", mimeType: "text/plain", buffer: Buffer.from(trace) });
  await page.getByText("trace.txt: 10000 messages").waitFor();
  assert.ok(await page.locator(".arrows text").count() < 80, "only those that are seen are in the page");
  const begun = Date.now();
  await page.locator(".sequence").press("End");
  await page.locator(".panel dd", { hasText: "9.999 s" }).waitFor();
  const took = Date.now() - begun;
  console.log(`from the first to the last of 10,000 messages in ${took} ms`);
  assert.ok(took < 1000, `${took} ms`);
  await page.getByLabel("Filter by zone").fill("7");
  await until("those of a zone", async () => (await page.locator(".filter p").textContent()).startsWith("112 of 10000"));
  await keep(page, "messages-trace");
  assert.deepEqual(await barriers(page), []);
  await page.getByLabel("Trace file").setInputFiles({ name: "no.txt", mimeType: "text/plain", buffer: Buffer.from("no trace") });
  await page.getByRole("alert").getByText("no.txt is not a trace").waitFor();
  noProblems();
});

test("the bell asks for permission and rings when a job ends", async () => {
  const context = await browser.newContext();
  await context.grantPermissions(["notifications"], { origin: `http://127.0.0.1:${farm.web}` });
  const other = await context.newPage();
  await other.addInitScript(() => {
    globalThis.rung = [];
    globalThis.Notification = class { static permission = "granted"; static async requestPermission() { return "granted"; } constructor(title, { body }) { globalThis.rung.push(`${title} ${body}`); } };
  });
  await other.goto(farm.steering);
  const bell = other.getByRole("button", { name: "Notify me" });
  await bell.click();
  await until("it is on", async () => await bell.getAttribute("aria-pressed") === "true");
  await other.waitForTimeout(1500);
  const request = { scene: { file: "cornell-box.glb" }, film: { size: [64, 48] }, goal: { samples: 4 }, output: { file: "bell.exr" } };
  const { job } = await farm.post("/jobs", { request, files_of_job: 1 });
  await until("it rings", () => other.evaluate(number => globalThis.rung.some(text => text.startsWith(`Job ${number}: done`)), job));
  await bell.click();
  assert.equal(await bell.getAttribute("aria-pressed"), "false");
  await context.close();
});

test("every view reads well in the light, in the dark, and on a phone", async () => {
  for (const [name, options] of Object.entries({
    light: { colorScheme: "light" },
    dark: { colorScheme: "dark" },
    phone: { colorScheme: "dark", viewport: { width: 390, height: 844 }, deviceScaleFactor: 2, hasTouch: true },
  })) {
    const other = await openPage(browser, options);
    await other.goto(farm.steering);
    for (const view of ["", "job/1", "machines", "messages", "messages/1", "submit"]) {
      await other.goto(`http://127.0.0.1:${farm.web}/#/${view}`);
      await other.waitForTimeout(2500);
      await keep(other, `${name}-${view.split("/")[0] || "jobs"}`);
      assert.deepEqual(await barriers(other), [], `${view} in ${name}`);
      const width = await other.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      assert.ok(width <= 0, `${view} in ${name} is ${width} pixels too wide`);
    }
    assert.deepEqual(other.problems, [], name);
    await other.context().close();
  }
});

test("who looks on sees everything and is shown nothing that steers", async () => {
  const other = await openPage(browser);
  await other.goto(farm.seeing);
  await other.locator(".jobs li").first().waitFor();
  assert.ok(await other.locator(".steers").first().isHidden());
  assert.equal(await other.getByRole("button", { name: /^(Pause|Cancel|Remove)/ }).filter({ visible: true }).count(), 0);
  assert.equal(await other.getByRole("link", { name: "New picture" }).filter({ visible: true }).count(), 0);
  await keep(other, "looks-on");
  await other.context().close();
});

test("a machine is suspended, resumed and sent away", async () => {
  await go("machines");
  const row = page.getByRole("table", { name: "Machines" }).locator("tbody tr:not(.spacer)");
  await row.first().waitFor();
  const name = await row.locator("td").first().textContent();
  const says = async text => { await row.getByText(text, { exact: true }).waitFor(JOB_WAIT); };
  await press(`Suspend ${name}`);
  await says("suspended");
  await press(`Resume ${name}`);
  await says("idle");
  await page.getByLabel("Filter machines").fill("nobody");
  await until("no row", async () => await row.count() === 0);
  await page.getByLabel("Filter machines").fill("");
  await press(`Terminate ${name}`);
  await page.getByRole("dialog").getByRole("button", { name: "Terminate" }).click();
  await page.getByText("No machines yet").waitFor(JOB_WAIT);
  await until("the process has ended", () => farm.worker.exitCode !== null);
  noProblems();
});

test("the page goes on when the process that serves it was killed and another one serves", async () => {
  await go("");
  await farm.kill(farm.up);
  await page.getByRole("status").getByText("No answer").waitFor(JOB_WAIT);
  await farm.startUp();
  await until("it answers again", async () => (await page.locator("#link").textContent()) === "");
  await page.locator(".jobs li").first().waitFor();
  page.problems.length = 0;
});
