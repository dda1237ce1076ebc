// A camera that is led around what it looks at: places and directions as `[x, y, z]`.

const add = (a, b) => a.map((value, i) => value + b[i]);
const less = (a, b) => a.map((value, i) => value - b[i]);
const times = (a, factor) => a.map(value => value * factor);
const dot = (a, b) => a.reduce((sum, value, i) => sum + value * b[i], 0);
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];
const unit = a => times(a, 1 / (Math.hypot(...a) || 1));

/** How near to straight up or down a camera may look, in radians. */
const POLE = 0.02;

/** Turns a place about an axis through the origin. */
function turned(place, axis, angle) {
  const [cosine, sine] = [Math.cos(angle), Math.sin(angle)];
  return add(add(times(place, cosine), times(cross(axis, place), sine)), times(axis, dot(axis, place) * (1 - cosine)));
}

/** The directions of a camera: to the right, up in the picture, and back. */
function frame({ eye, target, up }) {
  const back = unit(less(eye, target));
  const right = unit(cross(unit(up), back));
  return { right, above: cross(back, right), back };
}

/** The axis of the scene that is nearest to a camera's up: about it a camera is led, so that horizons stay level. */
export function levelUp(up) {
  const axis = up.reduce((best, value, i) => (Math.abs(value) > Math.abs(up[best]) ? i : best), 0);
  return up.map((_, i) => (i === axis ? Math.sign(up[axis]) || 1 : 0));
}

/** Leads a camera around its target by angles in radians: `across` to the right about what is up, `along` upward. */
export function orbit(pose, across, along) {
  const up = unit(pose.up);
  const spun = turned(less(pose.eye, pose.target), up, -across);
  const angle = Math.acos(Math.max(-1, Math.min(1, dot(unit(spun), up))));
  const wanted = Math.max(POLE, Math.min(Math.PI - POLE, angle - along));
  const axis = unit(cross(spun, up));
  return { ...pose, eye: add(pose.target, turned(spun, axis, angle - wanted)) };
}

/** Moves a camera and its target across the picture, by shares of the picture's height. */
export function pan(pose, across, along) {
  const { right, above } = frame(pose);
  const height = 2 * Math.hypot(...less(pose.eye, pose.target)) * Math.tan(((pose.fov ?? 40) * Math.PI) / 360);
  const by = add(times(right, -across * height), times(above, along * height));
  return { ...pose, eye: add(pose.eye, by), target: add(pose.target, by) };
}

/** Moves a camera towards its target; `factor` is that of the distance. */
export function dolly(pose, factor) {
  return { ...pose, eye: add(pose.target, times(less(pose.eye, pose.target), factor)) };
}
