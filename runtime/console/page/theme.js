// The style sheet's colours for canvas drawing; read again when the colour scheme changes.

const NAMES = [
  "paper",
  "panel",
  "ink",
  "muted",
  "line",
  "edge",
  "accent",
  "map",
  "grid",
  "axis",
  "truth",
  "truth-fill",
  "echo",
  "cross",
  "segment",
  "occupied",
  "free",
  "cluster",
  "model",
  "model-fill",
  "ellipse",
  "robot",
  "robot-fill",
  "vector",
  "chosen",
  "stop",
  "warning",
  "drive",
  "phase-0",
  "phase-1",
  "phase-2",
  "phase-3",
  "phase-4",
  "phase-5",
];

export const FONT = '"Inter", system-ui, "Segoe UI", Roboto, "Helvetica Neue", "DejaVu Sans", sans-serif';

export class Theme {
  constructor(changed) {
    this.#read();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.#read();
      changed();
    });
  }

  #read() {
    const style = getComputedStyle(document.documentElement);
    for (const name of NAMES) {
      const key = name.replace(/-(.)/g, (_, letter) => letter.toUpperCase());
      this[key] = style.getPropertyValue(`--${name}`).trim();
    }
  }

  font(pixels, weight = 500) {
    return `${weight} ${pixels}px ${FONT}`;
  }
}

// Resizes a canvas to its displayed size in device pixels and returns its context, scaled to CSS pixels.
export function fitted(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const width = canvas.clientWidth,
    height = canvas.clientHeight;
  const w = Math.max(1, Math.round(width * ratio)),
    h = Math.max(1, Math.round(height * ratio));
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
  }
  const ctx = canvas.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { ctx, width, height, ratio };
}
