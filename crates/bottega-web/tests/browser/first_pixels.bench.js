// How long it takes from `bottega up` to the first pixels of the first job in the browser, on one machine: run by hand, on a machine
// that does nothing else. `BOTTEGA=target/release/bottega node crates/bottega-web/tests/browser/first_pixels.bench.js [RUNS]`

import { fileURLToPath } from "node:url";
import { launch, openPage } from "./browser.js";
import { TestFarm } from "./farm.js";

const SCENE = fileURLToPath(new URL("../../../../scenes/cornell-box.glb", import.meta.url));
const runs = Number(process.argv[2] ?? 5);
const STEPS = ["address", "page", "form", "submitted", "pixels"];

/** Seconds since `bottega up` was started, by step. */
async function measure(browser) {
  const farm = new TestFarm();
  const begun = performance.now();
  const passed = () => (performance.now() - begun) / 1000;
  const times = {};
  try {
    await farm.start();
    times.address = passed();
    const page = await openPage(browser);
    await page.goto(farm.steering);
    await page.locator("h1").waitFor();
    times.page = passed();
    await page.goto(`http://127.0.0.1:${farm.web}/#/submit`);
    await page.locator("input[type=file]").first().setInputFiles(SCENE);
    await page.getByLabel("Width and height").fill("640 x 480");
    await page.getByLabel("Samples per pixel").fill("256");
    times.form = passed();
    await page.getByRole("button", { name: "Paint it", exact: true }).click();
    await page.waitForURL(/#\/job\/\d+$/);
    times.submitted = passed();
    await page.locator(".stage img.picture[src]").waitFor();
    times.pixels = passed();
    await page.context().close();
  } finally {
    await farm.stop();
  }
  return times;
}

const browser = await launch();
const all = [];
for (let run = 0; run < runs; run++) {
  all.push(await measure(browser));
  console.log(STEPS.map(step => `${step} ${all.at(-1)[step].toFixed(2)}`).join("  "));
}
await browser.close();
const median = step => all.map(it => it[step]).sort((a, b) => a - b)[Math.floor(runs / 2)];
console.log(`median of ${runs}, seconds since bottega up: ${STEPS.map(step => `${step} ${median(step).toFixed(2)}`).join("  ")}`);
