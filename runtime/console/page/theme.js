// @ts-check
// The style sheet's colours for canvas drawing; read again when the colour scheme changes.

export const FONT = '"Inter", system-ui, "Segoe UI", Roboto, "Helvetica Neue", "DejaVu Sans", sans-serif';

export class Theme {
  paper = "";
  panel = "";
  ink = "";
  muted = "";
  line = "";
  edge = "";
  accent = "";
  map = "";
  grid = "";
  axis = "";
  truth = "";
  truthFill = "";
  echo = "";
  cross = "";
  segment = "";
  occupied = "";
  free = "";
  cluster = "";
  model = "";
  modelFill = "";
  ellipse = "";
  robot = "";
  robotFill = "";
  vector = "";
  chosen = "";
  stop = "";
  warning = "";
  drive = "";
  phases = Array(6).fill("");

  /** @param {() => void} changed */
  constructor(changed) {
    this.#read();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.#read();
      changed();
    });
  }

  #read() {
    const style = getComputedStyle(document.documentElement);
    /** @param {string} name */
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    for (const [key, value] of Object.entries(this))
      if (typeof value === "string")
        Object.assign(this, { [key]: colour(key.replace(/[A-Z]/, (letter) => `-${letter.toLowerCase()}`)) });
    this.phases = this.phases.map((_, k) => colour(`phase-${k}`));
  }

  /** @param {number} pixels */
  font(pixels, weight = 500) {
    return `${weight} ${pixels}px ${FONT}`;
  }
}

// Resizes a canvas to its displayed size in device pixels and returns its context, scaled to CSS pixels.
/** @param {HTMLCanvasElement} canvas */
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
  const ctx = context(canvas);
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { ctx, width, height, ratio };
}

/** @param {HTMLCanvasElement} canvas */
export function context(canvas) {
  const ctx = canvas.getContext("2d");
  if (ctx === null) throw new Error("the browser draws no canvas");
  return ctx;
}
