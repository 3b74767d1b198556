// @ts-check
// The reference layers: grid, scale bar, and the true outlines that the emulator reports.

import { addLine, textWithHalo } from "./scene.js";

const STEPS = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100];
const GRID_PX = 44;
const SCALE_PX = 90; // at least, and less where the map is small

/** @param {Drawing} f @param {number} pixels */
function stepOf(f, pixels) {
  const unit = f.units.metres * f.view.scale;
  return (STEPS.find((step) => step * unit >= pixels) ?? STEPS[STEPS.length - 1]) * f.units.metres;
}

/** @param {Drawing} f */
export function drawGrid(f) {
  const { ctx, view, theme } = f;
  const step = stepOf(f, GRID_PX);
  const [left, top] = view.toWorld(0, 0);
  const [right, bottom] = view.toWorld(view.width, view.height);
  f.onScreen();
  ctx.font = theme.font(11);
  /** @param {number} from @param {number} to @param {(at: number, path: Path2D) => void} path */
  const lines = (from, to, path) => {
    const plain = new Path2D(),
      axis = new Path2D();
    for (let n = Math.ceil(from / step); n * step <= to; n++) path(n * step, n === 0 ? axis : plain);
    ctx.lineWidth = 1;
    ctx.strokeStyle = theme.grid;
    ctx.stroke(plain);
    ctx.lineWidth = 1.5;
    ctx.strokeStyle = theme.axis;
    ctx.stroke(axis);
  };
  /** @type {Array<[string, number, number, CanvasTextAlign]>} */
  const labels = [];
  const digits = step / f.units.metres < 0.1 ? 2 : step / f.units.metres < 1 ? 1 : 0;
  lines(left, right, (x, path) => {
    const sx = Math.round(view.toScreen(x, 0)[0]) + 0.5;
    path.moveTo(sx, 0);
    path.lineTo(sx, view.height);
    if (sx > 44 && sx < view.width - 40) labels.push([f.units.number(x, digits), sx, view.height - 6, "center"]);
  });
  lines(bottom, top, (y, path) => {
    const sy = Math.round(view.toScreen(0, y)[1]) + 0.5;
    path.moveTo(0, sy);
    path.lineTo(view.width, sy);
    if (sy > 16 && sy < view.height - 24)
      labels.push([f.units.number(y, digits), f.view.insets.left > 50 ? f.view.insets.left - 8 : 5, sy + 4, "left"]);
  });
  for (const [text, x, y, align] of labels) {
    ctx.textAlign = align;
    textWithHalo(f, text, x, y, theme.muted);
  }
}

/** @param {Drawing} f */
export function drawScale(f) {
  const { ctx, view, theme } = f;
  const step = stepOf(f, Math.min(SCALE_PX, view.width / 7));
  const width = step * view.scale;
  const x = view.width - width - 16.5,
    y = view.height - 21.5;
  f.onScreen();
  ctx.lineWidth = 2;
  ctx.strokeStyle = theme.ink;
  ctx.beginPath();
  ctx.moveTo(x, y - 5);
  ctx.lineTo(x, y);
  ctx.lineTo(x + width, y);
  ctx.lineTo(x + width, y - 5);
  ctx.stroke();
  ctx.font = theme.font(12, 600);
  ctx.textAlign = "center";
  const digits = step / f.units.metres < 0.1 ? 2 : step / f.units.metres < 1 ? 1 : 0;
  textWithHalo(f, f.units.length(step, digits), x + width / 2, y - 7, theme.ink);
}

/** @param {Drawing} f */
export function drawTruth(f) {
  const { ctx, theme, px } = f;
  const truth = f.run.session?.truth;
  if (!truth) return;
  f.inWorld();
  const closed = new Path2D(),
    lines = new Path2D();
  for (const [x, y, r] of truth.drums ?? []) {
    closed.moveTo(x + r, y);
    closed.arc(x, y, r, 0, 2 * Math.PI);
  }
  for (const polygon of truth.polygons ?? []) {
    addLine(closed, polygon);
    closed.closePath();
  }
  for (const [x1, y1, x2, y2] of truth.walls ?? []) {
    lines.moveTo(x1, y1);
    lines.lineTo(x2, y2);
  }
  ctx.fillStyle = theme.truthFill;
  ctx.fill(closed);
  ctx.strokeStyle = theme.truth;
  ctx.setLineDash([5 * px, 4 * px]);
  ctx.lineWidth = 1.2 * px;
  ctx.stroke(closed);
  ctx.lineWidth = 3 * px;
  ctx.setLineDash([]);
  ctx.stroke(lines);
}
