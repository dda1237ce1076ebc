// The HTTP API, as the page uses it.

/** An answer that says why something was not done. */
export class Problem extends Error {
  constructor(status, problem) {
    super([problem.detail, problem.remedy].filter(Boolean).join("; ") || `status ${status}`);
    this.status = status;
    /** What is wrong, without the remedy. */
    this.detail = problem.detail ?? this.message;
  }
}

/** The program that answers: its version, and whether it shows a `farm` or the `picture` of one process. */
export const about = { version: "", shows: "farm" };
/** Whether one picture is shown, with nothing of a farm around it. */
export const isOnePicture = () => about.shows === "picture";

/** Whether the token of this page lets it steer; known after the first answer. */
export let maySteer = true;

function readRole(response) {
  const role = response.headers.get("Bottega-Role");
  if (role === null) return;
  maySteer = role === "steer";
  document.body.classList.toggle("looks-on", !maySteer);
}

/** Asks the API. `body` is sent as JSON, or as bytes where it is a Blob. */
export async function ask(method, path, body) {
  const options = { method, headers: { Accept: "application/json" } };
  if (body instanceof Blob) {
    options.headers["Content-Type"] = "application/octet-stream";
    options.body = body;
  } else if (body !== undefined) {
    options.headers["Content-Type"] = "application/json";
    options.body = JSON.stringify(body);
  }
  const response = await fetch(`/api${path}`, options);
  readRole(response);
  if (!response.ok) throw new Problem(response.status, await response.json().catch(() => ({})));
  return response.status === 204 ? null : response.json();
}

export const get = path => ask("GET", path);

/** Fetches a picture unless it is the one of `tag`. Returns `{ blob, tag }`, or null if there is no picture or it is the same. */
export async function fetchPicture(path, tag) {
  const response = await fetch(`/api${path}`, tag ? { headers: { "If-None-Match": tag } } : {}).catch(() => null);
  if (response?.status !== 200) return null;
  return { blob: await response.blob(), tag: response.headers.get("ETag") };
}

/** Waits for another frame of a viewport than the one of `tag`; null: there is none yet. */
export async function fetchFrame(path, tag, signal) {
  const response = await fetch(`/api${path}`, { signal, headers: tag ? { "If-None-Match": tag } : {} });
  if (response.status === 304) return null;
  if (!response.ok) throw new Problem(response.status, await response.json().catch(() => ({})));
  const header = name => response.headers.get(`Bottega-${name}`);
  return {
    blob: await response.blob(), tag: response.headers.get("ETag"),
    look: Number(header("Look")), samples: Number(header("Samples")), isDenoised: header("Denoised") === "true",
    machines: Number(header("Machines")), bytesPerSecond: Number(header("Bytes-Per-Second")),
  };
}

/** Follows a job: `state` is called with the whole state, `changes` with what has changed since. Returns a function that ends it. */
export function follow(job, { state, changes, link }) {
  const source = new EventSource(`/api/jobs/${job}/events`);
  source.addEventListener("state", message => { link(true); state(JSON.parse(message.data)); });
  source.addEventListener("news", message => changes(JSON.parse(message.data)));
  // A stream that is closed for good was refused: the job was removed, which other questions find out.
  source.onerror = () => { if (source.readyState !== EventSource.CLOSED) link(false); };
  return () => source.close();
}
