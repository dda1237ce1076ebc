// The HTTP API, as the page uses it.

/** An answer that says why something was not done. */
export class Problem extends Error {
  constructor(status, problem) {
    super([problem.detail, problem.remedy].filter(Boolean).join("; ") || `status ${status}`);
    this.status = status;
  }
}

/** Asks the API. `body` is sent as JSON. */
export async function ask(method, path, body) {
  const options = { method, headers: { Accept: "application/json" } };
  if (body !== undefined) {
    options.headers["Content-Type"] = "application/json";
    options.body = JSON.stringify(body);
  }
  const response = await fetch(`/api${path}`, options);
  if (!response.ok) throw new Problem(response.status, await response.json().catch(() => ({})));
  return response.status === 204 ? null : response.json();
}

export const get = path => ask("GET", path);

/** Follows a job: `state` is called with all that is known, `news` with what has changed since. Returns what ends it. */
export function follow(job, { state, news, link }) {
  const source = new EventSource(`/api/jobs/${job}/events`);
  source.addEventListener("state", message => { link(true); state(JSON.parse(message.data)); });
  source.addEventListener("news", message => news(JSON.parse(message.data)));
  source.onerror = () => link(false);
  return () => source.close();
}
