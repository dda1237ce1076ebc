// Where a picture lies in a window: `screen = picture * scale + (x, y)`.

export const SCALE_MAX = 64;

/** The whole picture, in the middle of the window. */
export function fit(picture, window) {
  const scale = Math.min(window.width / picture.width, window.height / picture.height) || 1;
  return { scale, x: (window.width - picture.width * scale) / 2, y: (window.height - picture.height * scale) / 2 };
}

/** Zooms by a factor; the point of the window stays where it is. */
export function zoomAt(view, factor, point, scaleMin) {
  const scale = Math.min(SCALE_MAX, Math.max(Math.min(scaleMin, 1), view.scale * factor));
  const by = scale / view.scale;
  return { scale, x: point.x - (point.x - view.x) * by, y: point.y - (point.y - view.y) * by };
}

/** Keeps at least a part of the picture in the window. */
export function keepInside(view, picture, window) {
  const clamp = (at, size, room) => Math.min(room - Math.min(40, room), Math.max(Math.min(40, room) - size, at));
  return {
    scale: view.scale,
    x: clamp(view.x, picture.width * view.scale, window.width),
    y: clamp(view.y, picture.height * view.scale, window.height),
  };
}

/** Which pixel of the picture lies at a point of the window. */
export const toPicture = (view, point) => ({ x: (point.x - view.x) / view.scale, y: (point.y - view.y) / view.scale });
