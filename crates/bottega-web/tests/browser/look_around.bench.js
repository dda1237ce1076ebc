// How long it takes from a scene that is loaded to its first pixels in a viewport, and from a move of the camera to another view, in
// the browser, on one machine. Run by hand; several programs are measured in turn, so that they share what else the machine does:
// `BOTTEGA=target/release/bottega[:OTHER] node crates/bottega-web/tests/browser/look_around.bench.js [MOVES] [WIDTHxHEIGHT]`

import { fileURLToPath } from "node:url";
import { launch, openPage } from "./browser.js";
import { TestFarm, until } from "./farm.js";

const SCENE = fileURLToPath(new URL("../../../../scenes/cornell-box.glb", import.meta.url));
const ROUNDS = 3;
const [moves, size] = [Number(process.argv[2] ?? 20), process.argv[3] ?? "320x240"];
const programs = process.env.BOTTEGA.split(":");

/** First pixels and moves of one viewport, in milliseconds. */
async function measure(browser) {
  const farm = new TestFarm();
  try {
    await farm.start();
    const page = await openPage(browser);
    await page.goto(farm.steering);
    await page.goto(`http://127.0.0.1:${farm.web}/#/submit`);
    await page.locator("input[type=file]").first().setInputFiles(SCENE);
    await page.getByLabel("Width and height").fill(size.replace("x", " x "));
    await page.getByRole("button", { name: "Look around …" }).click();
    const stage = page.locator(".stage.around");
    const attribute = async name => Number(await stage.getAttribute(`data-${name}`) ?? -1);
    await until("something is seen", async () => await attribute("samples") >= 1);
    const box = await stage.boundingBox();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    const restarts = [];
    for (let move = 0; move < moves; move++) {
      // Now and then it has been still for so long that noise is removed.
      await page.waitForTimeout(move % 5 === 4 ? 2500 : 400);
      const seen = await attribute("look");
      await page.mouse.move(x, y);
      await page.mouse.down();
      await page.mouse.move(x + 20, y + 4);
      await page.mouse.up();
      await until("another view is seen", async () => await attribute("look") > seen);
      restarts.push(await attribute("restart"));
    }
    const first = await attribute("first");
    await page.context().close();
    return { first, restarts };
  } finally {
    await farm.stop();
  }
}

const sorted = values => [...values].sort((a, b) => a - b);
const median = values => sorted(values)[Math.floor(values.length / 2)];
const all = new Map(programs.map(program => [program, { first: [], restarts: [] }]));
const browser = await launch();
for (let round = 0; round < ROUNDS; round++) {
  for (const program of programs) {
    process.env.BOTTEGA = program;
    const { first, restarts } = await measure(browser);
    all.get(program).first.push(first);
    all.get(program).restarts.push(...restarts);
  }
}
await browser.close();
for (const [program, { first, restarts }] of all) {
  const within = restarts.filter(took => took <= 100).length;
  console.log(`${program}, ${size}: first pixels ${sorted(first).join(", ")} ms; another view after ${median(restarts)} ms (median of ${restarts.length}, ` +
    `${within} within 100 ms, ${sorted(restarts)[0]} to ${sorted(restarts).at(-1)} ms)`);
}
