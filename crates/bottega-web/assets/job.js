// One job: the picture while it is painted, its zones over it, its log.

import { follow } from "./api.js";
import { buttons, progress } from "./jobs.js";
import { element, percent, time } from "./format.js";

const SVG = "http://www.w3.org/2000/svg";
const LOOK_EVERY = 1000;

export function showJob(page, shell, number) {
  const head = element("div");
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("class", "picture");
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", `job ${number} as it is painted`);
  const image = document.createElementNS(SVG, "image");
  const boxes = document.createElementNS(SVG, "g");
  svg.append(image, boxes);
  const log = element("ul", { class: "log" });
  page.replaceChildren(head, svg, element("h2", {}, "Log"), log);

  let zones = new Map();
  let job;
  const bounds = () => {
    const all = [...zones.values()];
    if (!all.length) return;
    const [x0, y0] = [0, 1].map(i => Math.min(...all.map(zone => zone.rect[i])));
    const [x1, y1] = [2, 3].map(i => Math.max(...all.map(zone => zone.rect[i])));
    svg.setAttribute("viewBox", `${x0} ${y0} ${x1 - x0} ${y1 - y0}`);
    for (const [key, value] of Object.entries({ x: x0, y: y0, width: x1 - x0, height: y1 - y0 })) image.setAttribute(key, value);
  };
  const take = {
    job(event) {
      job = event;
      const words = [`${event.state}, ${percent(event.done)}`, `${event.zones_done} of ${event.zones} zones`,
        `${event.machines} machines`, `led by ${event.leader ?? "nobody"}`, event.reason];
      head.replaceChildren(element("h1", {}, `Job ${event.job}: ${event.scene}`), progress(event),
        element("p", {}, words.filter(Boolean).join(" · ")), element("p", {}, buttons(event, shell, () => {}),
          event.kept ? element("a", { href: `/api/jobs/${number}/picture`, download: "" }, " Download the picture") : null));
    },
    zone(event) { zones.set(event.id, event); },
    note(event) { log.prepend(element("li", {}, event.message)); },
    warning(event) { log.prepend(element("li", { class: "warning" }, event.message)); },
    removed() { head.replaceChildren(element("p", {}, `Job ${number} was removed.`)); },
  };
  const draw = events => {
    events.forEach(event => take[event.event]?.(event));
    if (!events.some(event => event.event === "zone")) return;
    bounds();
    for (const zone of events.filter(event => event.event === "zone")) drawZone(boxes, zone);
  };
  const end = follow(number, {
    link: isUp => shell.link(isUp),
    state(events) { zones = new Map(); boxes.replaceChildren(); log.replaceChildren(); draw(events); },
    news: draw,
  });

  let tag, shown;
  const look = async () => {
    if (tag && job && job.state !== "active" && shown === job.state) return;
    const response = await fetch(`/api/jobs/${number}/preview.png`, tag ? { headers: { "If-None-Match": tag } } : {}).catch(() => null);
    if (response?.status !== 200) return;
    [tag, shown] = [response.headers.get("ETag"), job?.state];
    const before = image.getAttribute("href");
    image.setAttribute("href", URL.createObjectURL(await response.blob()));
    if (before) setTimeout(() => URL.revokeObjectURL(before), LOOK_EVERY);
  };
  look();
  const timer = setInterval(look, LOOK_EVERY);
  return () => { end(); clearInterval(timer); };
}

function drawZone(boxes, zone) {
  const id = `zone-${zone.id}`;
  let box = boxes.querySelector(`#${id}`);
  if (!box) {
    box = document.createElementNS(SVG, "rect");
    box.id = id;
    box.append(document.createElementNS(SVG, "title"));
    boxes.append(box);
  }
  const [x0, y0, x1, y1] = zone.rect;
  for (const [key, value] of Object.entries({ x: x0, y: y0, width: x1 - x0, height: y1 - y0 })) box.setAttribute(key, value);
  box.setAttribute("class", zone.state);
  box.firstChild.textContent = `zone ${zone.id}: ${zone.state}${zone.agent ? ` by ${zone.agent}` : ""}, ` +
    `expected ${time(zone.seconds_estimated)}, took ${time(zone.seconds_measured)}`;
}
