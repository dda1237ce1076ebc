// Chromium, driven by Playwright; and axe-core, which looks for what keeps people out.

import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { fileURLToPath } from "node:url";

const ROOT = fileURLToPath(new URL("../../../../", import.meta.url));
const require = createRequire(join(ROOT, "target/node/"));
const PICTURES = join(ROOT, "target/pictures");

/** Starts the browser that `BOTTEGA_CHROMIUM` names. */
export async function launch() {
  const { chromium } = require("playwright-core");
  const executablePath = process.env.BOTTEGA_CHROMIUM ?? "/usr/bin/chromium";
  // Without the sandbox it also runs as root, in a container.
  return chromium.launch({ executablePath, args: ["--no-sandbox"] });
}

/** A page that remembers what went wrong in it, in `page.problems`. */
export async function openPage(browser, options = {}) {
  const context = await browser.newContext({ viewport: { width: 1400, height: 900 }, ...options });
  context.setDefaultTimeout(15_000);
  const page = await context.newPage();
  page.problems = [];
  page.on("pageerror", error => page.problems.push(error.message));
  page.on("console", message => {
    if (message.type() === "error" || message.type() === "warning") page.problems.push(`${message.text()} ${message.location().url}`.trim());
  });
  return page;
}

/** Keeps a picture of a page in `target/pictures`. */
export async function keep(page, name) {
  mkdirSync(PICTURES, { recursive: true });
  await page.screenshot({ path: join(PICTURES, `page-${name}.png`), fullPage: true });
}

/** Whether pictures of the manual are wanted. */
export const makesManual = Boolean(process.env.BOTTEGA_MANUAL_PICTURES);
/** Bytes of a picture of the manual at most. */
const MANUAL_BYTES_MAX = 60_000;
/** Columns of a picture of the manual. */
const MANUAL_WIDTH = 1200;

/** Keeps what is on the screen of a page as a picture of the manual, `page-NAME.webp`, where such pictures are wanted. */
export async function keepForManual(page, name) {
  if (!makesManual) return;
  // Without what is empty below it.
  const [width, height] = await page.evaluate(() => [innerWidth, Math.min(innerHeight, document.body.offsetHeight - scrollY)]);
  const png = (await page.screenshot({ clip: { x: 0, y: 0, width, height } })).toString("base64");
  // The browser itself writes WebP, in a page that has no rules of ours.
  const blank = await page.context().browser().newPage();
  const written = await blank.evaluate(async ([data, max, width]) => {
    const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${data}`)).blob());
    const canvas = Object.assign(document.createElement("canvas"), { width, height: Math.round(image.height * width / image.width) });
    const pen = canvas.getContext("2d");
    pen.imageSmoothingQuality = "high";
    pen.drawImage(image, 0, 0, canvas.width, canvas.height);
    for (let quality = 0.9; ; quality -= 0.05) {
      const url = canvas.toDataURL("image/webp", quality);
      if (url.length * 3 / 4 < max || quality < 0.3) return url.split(",")[1];
    }
  }, [png, MANUAL_BYTES_MAX, MANUAL_WIDTH]);
  await blank.close();
  writeFileSync(join(resolve(ROOT, process.env.BOTTEGA_MANUAL_PICTURES), `page-${name}.webp`), Buffer.from(written, "base64"));
}

/** What axe-core finds that is serious or critical, as texts. */
export async function barriers(page) {
  // The page's rules allow no foreign script in it; the debugger may.
  await page.evaluate(readFileSync(require.resolve("axe-core/axe.min.js"), "utf8"));
  const { violations } = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ["violations"] }));
  const serious = violations.filter(({ impact }) => impact === "serious" || impact === "critical");
  return serious.map(({ id, nodes }) => `${id}: ${nodes.map(node => `${node.html} ${node.failureSummary}`).join("; ")}`);
}
