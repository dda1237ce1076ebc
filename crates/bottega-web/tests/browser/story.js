// A story in the browser: steps one after the other on one page, of a farm of its own.

import assert from "node:assert/strict";
import { after, before, test as nodeTest } from "node:test";
import { fileURLToPath } from "node:url";
import { launch, openPage } from "./browser.js";
import { TestFarm } from "./farm.js";

export const SCENE = fileURLToPath(new URL("../../../../scenes/cornell-box.glb", import.meta.url));
export const JOB_WAIT = { timeout: 90_000 };

export const farm = new TestFarm();
export let browser, page;
let hasFailed = false;

/** A step of one story: after one that failed the others say nothing. */
export const test = (name, work) => nodeTest(name, async context => {
  if (hasFailed) return context.skip("an earlier step failed");
  hasFailed = true;
  await work();
  hasFailed = false;
  return undefined;
});

before(async () => {
  await farm.start();
  browser = await launch();
  page = await openPage(browser, { acceptDownloads: true });
  await page.goto(farm.steering);
});

after(async () => {
  await browser?.close();
  await farm.stop();
});

export const go = async view => {
  await page.goto(`http://127.0.0.1:${farm.web}/#/${view}`);
  await page.locator("h1").waitFor();
};
export const press = name => page.getByRole("button", { name, exact: true }).click();
export const chip = state => page.locator(`.chip[data-state=${state}]`).first();
export const number = () => Number(page.url().split("/").pop());
export const noProblems = (isExpected = () => false) => {
  assert.deepEqual(page.problems.splice(0).filter(it => !isExpected(it)), []);
};
