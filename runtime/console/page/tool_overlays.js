// @ts-check
// What the tools draw on the map: the crosshair, the lasso, the outline being moved, the tape.

import { outlinePath } from "./draw_objects.js";
import { addLine, pairOf, textWithHalo } from "./scene.js";
import { degrees } from "./units.js";

/** @param {Drawing} f @param {Point} at */
export function drawCross(f, { x, y }) {
  const { ctx, theme } = f;
  const [sx, sy] = f.view.toScreen(x, y);
  f.onScreen();
  ctx.save();
  for (const isHalo of [true, false]) {
    ctx.strokeStyle = isHalo ? theme.map : theme.ink;
    ctx.lineWidth = isHalo ? 5 : 2;
    ctx.beginPath();
    for (const [dx, dy] of [
      [1, 0],
      [-1, 0],
      [0, 1],
      [0, -1],
    ]) {
      ctx.moveTo(sx + 4 * dx, sy + 4 * dy);
      ctx.lineTo(sx + 14 * dx, sy + 14 * dy);
    }
    ctx.stroke();
  }
  ctx.font = theme.font(11.5, 600);
  ctx.textAlign = "left";
  textWithHalo(f, f.units.place(x, y), sx + 12, sy - 10, theme.ink);
  ctx.restore();
}

/** @param {Drawing} f @param {Point[]} points */
export function drawLasso(f, points) {
  if (points.length < 2) return;
  const { ctx, theme, px } = f;
  ctx.save();
  f.inWorld();
  ctx.beginPath();
  addLine(ctx, points.map(pairOf));
  ctx.closePath();
  ctx.globalAlpha = 0.15;
  ctx.fillStyle = theme.accent;
  ctx.fill();
  ctx.globalAlpha = 1;
  ctx.strokeStyle = theme.accent;
  ctx.lineWidth = 1.6 * px;
  ctx.setLineDash([6 * px, 4 * px]);
  ctx.stroke();
  ctx.restore();
}

// Previews an outline at its new pose, with the handle that rotates it.
/** @param {Drawing} f @param {ModelRow | null} model @param {Pose} pose @param {Point | null} handle */
export function drawPreview(f, model, pose, handle) {
  const { x, y, theta } = pose;
  const { ctx, theme, px } = f;
  const path = new Path2D();
  outlinePath(path, model, pose, px);
  ctx.save();
  f.inWorld();
  ctx.strokeStyle = theme.accent;
  ctx.lineWidth = 2.5 * px;
  ctx.setLineDash([8 * px, 4 * px]);
  ctx.stroke(path);
  ctx.setLineDash([]);
  if (handle) {
    ctx.lineWidth = 1.5 * px;
    ctx.beginPath();
    ctx.moveTo(x, y);
    ctx.lineTo(handle.x, handle.y);
    ctx.stroke();
    ctx.beginPath();
    ctx.arc(handle.x, handle.y, 8 * px, 0, 2 * Math.PI);
    ctx.fillStyle = theme.map;
    ctx.fill();
    ctx.lineWidth = 2.5 * px;
    ctx.stroke();
  }
  f.onScreen();
  ctx.font = theme.font(11.5, 600);
  ctx.textAlign = "left";
  const [sx, sy] = f.view.toScreen(x, y);
  textWithHalo(f, `${f.units.place(x, y)}, ${degrees(theta)}`, sx + 14, sy + 20, theme.ink);
  ctx.restore();
}

/** @param {Drawing} f @param {Point} from @param {Point} to */
export function drawTape(f, from, to) {
  const { ctx, theme } = f;
  const [ax, ay] = f.view.toScreen(from.x, from.y),
    [bx, by] = f.view.toScreen(to.x, to.y);
  const angle = Math.atan2(by - ay, bx - ax) + Math.PI / 2;
  const dx = 7 * Math.cos(angle),
    dy = 7 * Math.sin(angle);
  ctx.save();
  f.onScreen();
  for (const isHalo of [true, false]) {
    ctx.strokeStyle = isHalo ? theme.map : theme.ink;
    ctx.lineWidth = isHalo ? 5 : 2;
    ctx.beginPath();
    ctx.moveTo(ax, ay);
    ctx.lineTo(bx, by);
    for (const [x, y] of [
      [ax, ay],
      [bx, by],
    ]) {
      ctx.moveTo(x - dx, y - dy);
      ctx.lineTo(x + dx, y + dy);
    }
    ctx.stroke();
  }
  ctx.font = theme.font(13, 700);
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  const text = describeTape(f.units, from, to);
  textWithHalo(f, text, (ax + bx) / 2, (ay + by) / 2 - 14, theme.ink);
  ctx.restore();
}

/** @param {Units} units @param {Point} from @param {Point} to */
export function describeTape(units, from, to) {
  const dx = to.x - from.x,
    dy = to.y - from.y;
  return `${units.length(Math.hypot(dx, dy), 3)} at ${degrees(Math.atan2(dy, dx))}`;
}
