// What the drawing and the plots share: a canvas that is as sharp as the screen, in the colours of the page.

export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

// Sizes a canvas to its place. Returns its context, and its width and height [CSS px]; null if it isn't shown.
export function prepared(canvas, ratio) {
  const width = canvas.clientWidth;
  if (width === 0) return null;
  const height = Math.round(width * ratio);
  const scale = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "12px system-ui, sans-serif";
  context.lineJoin = "round";
  return { context, width, height };
}
