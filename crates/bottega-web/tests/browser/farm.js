// A real farm on this machine: `bottega up` and one worker.

import { spawn } from "node:child_process";
import { closeSync, mkdirSync, mkdtempSync, openSync, readFileSync, rmSync } from "node:fs";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";

const WAIT = 60_000;

const pause = ms => new Promise(done => setTimeout(done, ms));

async function freePort() {
  const server = createServer().listen(0, "127.0.0.1");
  await new Promise(done => server.once("listening", done));
  const { port } = server.address();
  await new Promise(done => server.close(done));
  return port;
}

/** Waits until something is true. */
export async function until(what, check, wait = WAIT) {
  for (const begun = Date.now(); Date.now() - begun < wait; await pause(50)) {
    const found = await check();
    if (found) return found;
  }
  throw new Error(`waited ${wait / 1000} s in vain: ${what}`);
}

/** A farm; `BOTTEGA` names the program, `BOTTEGA_NATS_SERVER` its NATS server. */
export class TestFarm {
  #folder = mkdtempSync(join(tmpdir(), "bottega-page-"));
  #processes = new Set();

  async start() {
    [this.port, this.web] = [await freePort(), await freePort()];
    await this.startUp();
    this.worker = this.join("worker");
  }

  /** Has another machine join. */
  join(name) {
    return this.#run(name, ["join", "--threads", "1", "--watts", "100", "--cache", join(this.#folder, `cache-${name}`)]);
  }

  /** Runs a command of the program to its end, in the folder of the farm. Returns what it printed. */
  async command(words) {
    const child = this.#run("command", words);
    const code = await new Promise(done => child.once("exit", done));
    const printed = readFileSync(this.#log("command"), "utf8");
    if (code !== 0) throw new Error(`bottega ${words.join(" ")}: ${code}\n${printed}`);
    return printed;
  }

  /** Starts `bottega render --dashboard`. Returns its process and the address that it printed. */
  async dashboard(words) {
    const child = this.#run("dashboard", ["render", ...words, "--dashboard", `127.0.0.1:${await freePort()}`]);
    const printed = () => readFileSync(this.#log("dashboard"), "utf8").match(/https?:\/\/127\.0\.0\.1:\d+\/\?token=\w+/)?.[0];
    return { child, url: await until("the dashboard prints its address", printed) };
  }

  /** The path of a file in the folder of the farm, for what commands read and write. */
  place(...names) {
    const path = join(this.#folder, "files", ...names);
    mkdirSync(dirname(path), { recursive: true });
    return path;
  }

  /** Starts `bottega up`; again after it was killed. */
  async startUp() {
    const words = ["up", "--listen", `127.0.0.1:${this.port}`, "--hidden", "--web", `127.0.0.1:${this.web}`, "--fipa", "127.0.0.1:0", "--store-size", "1", "--price-per-kwh", "0.5", "--currency", "EUR"];
    if (process.env.BOTTEGA_NATS_SERVER) words.push("--server", process.env.BOTTEGA_NATS_SERVER);
    this.up = this.#run("up", words);
    const urls = () => readFileSync(this.#log("up"), "utf8").match(/https?:\/\/127\.0\.0\.1:\d+\/\?token=\w+/g);
    [this.steering, this.seeing] = await until("bottega up prints its addresses", () => (urls()?.length === 2 ? urls() : null));
  }

  async stop() {
    for (const child of this.#processes) await end(child, "SIGTERM");
    rmSync(this.#folder, { recursive: true, force: true });
  }

  /** What the API says, to whom may steer. */
  async ask(path, token = new URL(this.steering).searchParams.get("token")) {
    const response = await fetch(`http://127.0.0.1:${this.web}/api${path}`, { headers: { Authorization: `Bearer ${token}` } });
    if (!response.ok) throw new Error(`${path}: ${response.status} ${await response.text()}`);
    return response.json();
  }

  /** Asks the API for something, as one who may steer. */
  async post(path, body) {
    const token = new URL(this.steering).searchParams.get("token");
    const headers = { Authorization: `Bearer ${token}`, "Content-Type": "application/json" };
    const response = await fetch(`http://127.0.0.1:${this.web}/api${path}`, { method: "POST", headers, body: JSON.stringify(body) });
    if (!response.ok) throw new Error(`${path}: ${response.status} ${await response.text()}`);
    return response.json();
  }

  async kill(child) { await end(child, "SIGKILL"); }

  #log(name) { return join(this.#folder, `${name}.log`); }

  #run(name, words) {
    const state = join(this.#folder, "state");
    mkdirSync(state, { recursive: true });
    const env = { ...process.env, XDG_STATE_HOME: state, XDG_CACHE_HOME: join(this.#folder, "cache") };
    delete env.BOTTEGA_FARM;
    const log = openSync(this.#log(name), "w");
    const child = spawn(process.env.BOTTEGA, words, { env, stdio: ["ignore", log, log] });
    closeSync(log);
    this.#processes.add(child);
    child.once("exit", () => this.#processes.delete(child));
    return child;
  }
}

async function end(child, signal) {
  if (child.exitCode !== null || child.signalCode !== null) return;
  const ended = new Promise(done => child.once("exit", done));
  child.kill(signal);
  await Promise.race([ended, pause(10_000).then(() => child.kill("SIGKILL"))]);
}
