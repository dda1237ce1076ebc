// Every view of the page at the widths of two usual screens: nothing sticks out, and what the view is for is in sight. A job that the
// command line submitted is painted again as it was. Of a real farm of two machines, in a real browser.
//
// BOTTEGA_MANUAL_PICTURES=docs/pictures makes the pictures of the manual again, finer than tests need.

import assert from "node:assert/strict";
import { existsSync, writeFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { barriers, keep, keepForManual, makesManual, openPage } from "./browser.js";
import { until } from "./farm.js";
import { SCENE, JOB_WAIT, browser, farm, go, noProblems, number, page, press, test } from "./story.js";

const TABLE = fileURLToPath(new URL("../../../../scenes/goblets.glb", import.meta.url));
/** What the pictures show. */
const [SIZE, SAMPLES] = makesManual ? ["640x400", 40] : ["160x100", 8];
/** Of a picture that is painted until it is called off; in the manual some zones are done by then. */
const [LONG_SAMPLES, LONG_ZONES, DONE_ZONES] = makesManual ? [300, 40, 5] : [100_000, 24, 0];
const WIDTHS = [1440, 1024];
/** Environment light, of four pixels. */
const LIGHT = Buffer.from("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 2\n\x80\x80\x80\x81\x60\x40\x20\x81\x20\x40\x60\x81\x10\x10\x10\x80", "latin1");

const LIGHT_AROUND = ["--env", "0.25,0.3,0.38"];

const job = id => farm.ask(`/jobs/${id}`);
const isDone = async id => (await job(id)).state === "done";
const alertIn = selector => page.locator(selector).getByRole("alert");

/** Looks at a view at all widths. `isShown`: the manual has a picture of it. */
async function look(name, { of = page, isReady = async () => true, isShown = true } = {}) {
  for (const width of WIDTHS) {
    await of.setViewportSize({ width, height: 900 });
    await until(`${name} is ready`, isReady);
    await of.mouse.move(0, 0);
    // A request made at this size is drawn with the next frames.
    await of.evaluate(() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done))));
    await keep(of, `view-${name}-${width}`);
    const excess = await of.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    assert.ok(excess <= 0, `${name} is ${excess} pixels too wide at ${width}`);
    if (width === WIDTHS[0] && isShown) await keepForManual(of, name);
  }
  await of.setViewportSize({ width: WIDTHS[0], height: 900 });
}

test("a job that the command line submitted is painted again as it was, and a problem is shown beside its button", async () => {
  const light = farm.place("sky", "noon.hdr");
  writeFileSync(light, LIGHT);
  const pose = { eye: [0.4, 1.2, 3], target: [0, 1, 0], up: [0, 1, 0], fov: null };
  await farm.command(["render", SCENE, "--env", light, "--size", "96x72", "--spp", "4", "--set", `view.pose=${JSON.stringify(pose)}`,
    "-o", farm.place("out", "room.exr"), "--farm", "--detach"]);
  await until("it is done", () => isDone(1));
  await go("job/1");
  await page.getByRole("link", { name: "Paint this scene again …" }).click();
  await page.getByText("The form shows the request of job 1").waitFor();
  assert.equal(await page.getByLabel("Width and height").inputValue(), "96, 72");
  assert.equal(await page.getByLabel("Samples per pixel").inputValue(), "4");
  assert.equal(await page.getByLabel("Environment light: File").inputValue(), "noon.hdr");
  const request = JSON.parse(await page.locator("form pre").textContent());
  assert.deepEqual(request.view.pose, pose);
  assert.equal(request.output.file, "room.exr");
  await press("Look around …");
  await until("something is seen", async () => Number(await page.locator(".stage.around").getAttribute("data-samples").catch(() => 0)) > 0);
  await page.getByLabel("Samples per pixel").fill("0");
  await press("Paint it");
  await alertIn(".send").getByText("goal.samples").waitFor();
  await page.getByLabel("Samples per pixel").fill("4");
  await page.getByLabel("Environment light: File").fill("night.hdr");
  await press("Look around …");
  await alertIn("fieldset > .row").getByText("night.hdr").waitFor();
  await page.getByLabel("Environment light: File").fill("noon.hdr");
  await press("Paint it");
  await page.waitForURL(/#\/job\/\d+$/, JOB_WAIT);
  const again = number();
  await until("it is done again", () => isDone(again));
  assert.equal((await farm.ask(`/jobs/1/difference/job-${again}`)).rmse, 0, "the same picture");
  noProblems(it => it.includes("422"));
});

test("every view of an unknown job says that there is none", async () => {
  for (const view of ["job/999", "messages/999", "submit/999", "job/abc", "job"]) {
    await page.goto(`http://127.0.0.1:${farm.web}/#/${view}`);
    await page.getByRole("heading", { name: /There is no job (999|abc)|No job is named/ }).waitFor();
    assert.equal(await page.locator("progress, .stage, form.submit").count(), 0, view);
  }
  assert.deepEqual(await barriers(page), []);
  await page.getByRole("link", { name: "All jobs" }).click();
  await page.getByRole("heading", { name: "Jobs" }).waitFor();
  noProblems(it => it.includes("404"));
});

test("two machines that paint are seen with all that can be done to them", async () => {
  farm.join("second");
  await until("two machines", async () => (await farm.ask("/machines")).length === 2);
  const submit = (name, ...words) => farm.command(["render", TABLE, ...LIGHT_AROUND, "--size", SIZE, "-o", farm.place(name), "--farm", "--detach", ...words]);
  await submit("table.exr", "--spp", `${SAMPLES}`);
  await submit("coarse.exr", "--spp", "2");
  await until("both are done", async () => await isDone(3) && isDone(4), 600_000);
  await submit("fine.exr", "--spp", `${LONG_SAMPLES}`, "--optimize", "n", "--set", `work.zones=${LONG_ZONES}`, "--priority", "20");
  await go("machines");
  const rows = page.getByRole("table", { name: "Machines" }).locator("tbody tr:not(.spacer)");
  const isBusy = async () => (await rows.getByText("painting").count()) === 2 && (await rows.locator(".spark polyline[points*=' ']").count()) >= 2;
  await look("machines", { isReady: isBusy });
  for (const width of WIDTHS) {
    await page.setViewportSize({ width, height: 900 });
    const excess = await page.locator(".table-window").evaluate(it => it.scrollWidth - it.clientWidth);
    assert.ok(excess <= 0, `the table is ${excess} pixels too wide at ${width}`);
    for (const button of await page.getByRole("button", { name: /^Terminate/ }).all()) {
      const box = await button.boundingBox();
      assert.ok(box.x + box.width <= width, `Terminate ends at ${box.x + box.width} of ${width}`);
    }
  }
  // One that has gone in the meantime: the problem is shown beside the button.
  await page.route("**/api/machines/*/suspend", route => route.fulfill({ status: 404, contentType: "application/problem+json", body: '{"status":404,"detail":"no such machine is there"}' }));
  await page.getByRole("button", { name: /^Suspend/ }).first().click();
  await alertIn("td.orders").getByText("no such machine is there").waitFor();
  await page.unroute("**/api/machines/*/suspend");
  noProblems(it => it.includes("404"));
});

test("zones are outlines with what is expected of them, and importance has a legend", async () => {
  await go("job/5");
  const label = page.locator(".legend");
  await until("an agent is named", async () => (await label.first().textContent()).includes("render-"));
  await until("some zones are done", async () => (await job(5)).zones_done >= DONE_ZONES, 600_000);
  const alpha = () => page.locator("canvas.zones").evaluate(canvas => {
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    for (let i = 3; i < data.length; i += 4) if (data[i]) count++;
    return count / (data.length / 4);
  });
  await until("outlines", async () => (await alpha()) > 0 && (await alpha()) < 0.4);
  await page.locator(".stage").click({ position: { x: 300, y: 300 } });
  await page.locator(".panel h2", { hasText: /^Zone \d/ }).waitFor();
  await look("job");
  await page.getByLabel("Filled").check();
  await until("areas", async () => (await alpha()) > 0.55);
  await page.getByLabel("Filled").uncheck();
  await page.getByLabel("Color by").selectOption("expected");
  await page.getByLabel("Importance").check();
  await page.locator(".legend", { hasText: "predicted to cost" }).waitFor();
  await look("importance");
  assert.deepEqual(await barriers(page), []);
  await page.locator(".rules > summary").click();
  await page.locator(".membership").first().waitFor(JOB_WAIT);
  await page.locator(".rules").scrollIntoViewIfNeeded();
  await look("rules");
  noProblems();
});

test("the lanes of the messages between two machines have names of their own", async () => {
  await go("messages/5");
  await page.locator(".arrows text").first().waitFor(JOB_WAIT);
  await until("agents of two machines", async () => (await page.locator(".lane-name b", { hasText: "render-" }).count()) >= 2);
  const names = await page.locator(".lane-name").allTextContents();
  assert.equal(new Set(names).size, names.length, names.join(", "));
  await page.getByLabel("Follow").uncheck();
  await page.locator(".messages-space").click({ position: { x: 200, y: 200 } });
  await look("messages");
  noProblems();
});

test("the jobs, a picture that is done and another one beside it fit the screen", async () => {
  await go("");
  await look("jobs", { isReady: async () => (await page.locator(".thumb img[src]").count()) >= 3 });
  await go("job/3");
  await page.locator("img.picture[src]").waitFor(JOB_WAIT);
  await look("done", { isShown: false });
  const others = page.getByLabel("Compare with", { exact: true });
  await others.focus();
  await until("it is listed", async () => (await others.locator("option[value=job-4]").count()) === 1);
  await others.selectOption("job-4");
  await page.getByText(/FLIP 0\.\d+, seen in/).waitFor(JOB_WAIT);
  await look("compare");
  noProblems();
});

test("the form and the view through a scene fit the screen", async () => {
  await go("submit/3");
  await page.getByText("The form shows the request of job 3").waitFor();
  await look("submit", { isShown: false });
  await press("Look around …");
  const around = page.locator(".stage.around");
  await until("it is fine", async () => Number(await around.getAttribute("data-samples").catch(() => 0)) >= (makesManual ? 32 : 1), 240_000);
  await look("look-around");
  await go("submit");
  await page.getByText("Drop a scene here").waitFor();
  await look("new-picture");
  noProblems();
});

test("the page names its version and leads to the manual of it", async () => {
  assert.match(await page.locator("footer").textContent(), /Bottega \d+\.\d+\.\d+/);
  await page.locator("footer").getByRole("link", { name: "Manual" }).click();
  await page.getByRole("heading", { name: "The manual" }).first().waitFor();
  await look("manual", { isShown: false });
  await page.getByRole("link", { name: "Many machines" }).first().click();
  await page.locator("#in-a-browser").waitFor();
  await until("its pictures", () => page.evaluate(() => [...document.images].every(it => it.naturalWidth > 0)));
  assert.deepEqual(await barriers(page), []);
  assert.equal((await page.request.get(`http://127.0.0.1:${farm.web}/icon.svg`)).headers()["content-type"], "image/svg+xml");
  await page.goto(`http://127.0.0.1:${farm.web}/`);
  await farm.post("/jobs/5/cancel", {});
  noProblems();
});

test("the picture of one process is shown without a farm around it", async () => {
  const output = farm.place("alone.png");
  const { child, url } = await farm.dashboard([TABLE, ...LIGHT_AROUND, "--size", SIZE, "--spp", "100000", "-o", output, "--threads", "1"]);
  const other = await openPage(browser);
  await other.goto(url);
  await other.locator(".stage img.picture[src]").waitFor(JOB_WAIT);
  const seen = async role => (await other.getByRole(role).filter({ visible: true }).allTextContents()).join("|");
  assert.match(await seen("button"), /Stop/);
  assert.doesNotMatch(await seen("button"), /Pause|Remove|Cancel|Paint it again/);
  assert.doesNotMatch(await seen("link"), /Jobs|Machines|New picture|Paint this scene again/);
  assert.match(await seen("link"), /Picture.*Messages/);
  assert.equal(await other.getByLabel("Priority").filter({ visible: true }).count(), 0);
  await look("picture", { of: other });
  assert.deepEqual(await barriers(other), []);
  await other.getByRole("button", { name: "Look around …" }).click();
  await until("something is seen", async () => Number(await other.locator(".stage.around").getAttribute("data-samples").catch(() => 0)) > 0);
  assert.match(await other.locator("pre").first().textContent(), /^--set 'view\.pose=\{"eye":\[/);
  await other.goto(`${new URL(url).origin}/#/job/2`);
  await other.getByRole("heading", { name: "There is no job 2" }).waitFor();
  await other.getByRole("link", { name: "The picture of this process" }).click();
  await other.getByRole("button", { name: "Stop" }).click();
  await other.getByRole("dialog").getByRole("button", { name: "Stop" }).click();
  await until("the process ends", () => child.exitCode !== null);
  assert.ok(existsSync(output), "what was painted is written");
  await other.context().close();
});
