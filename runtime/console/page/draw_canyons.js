// @ts-check
// Box canyons: the mouth as a bar across the way in, the closed outline behind it, the axis, depth and probability.

import { textWithHalo } from "./scene.js";
import { percent } from "./units.js";

const SURE = 0.9; // from here on leave-canyon stays outside
const AXIS_MAX_PX = 60;

/** @param {Drawing} f */
export function drawCanyons(f) {
  for (const canyon of f.run.state.canyons) drawCanyon(f, canyon);
}

/** @param {Drawing} f @param {CanyonRow} canyon */
function drawCanyon(f, { mouth: [x1, y1, x2, y2], axis, depth, probability }) {
  const { ctx, px, theme } = f;
  const dx = Math.cos(axis),
    dy = Math.sin(axis);
  f.inWorld();
  ctx.strokeStyle = theme.stop;
  ctx.lineWidth = 1.2 * px;
  ctx.setLineDash([2 * px, 4 * px]);
  ctx.beginPath();
  ctx.moveTo(x1, y1);
  ctx.lineTo(x1 + depth * dx, y1 + depth * dy);
  ctx.lineTo(x2 + depth * dx, y2 + depth * dy);
  ctx.lineTo(x2, y2);
  ctx.stroke();
  ctx.setLineDash(probability >= SURE ? [] : [7 * px, 4 * px]);
  ctx.lineWidth = 3 * px;
  ctx.beginPath();
  ctx.moveTo(x1, y1);
  ctx.lineTo(x2, y2);
  ctx.stroke();
  const x = 0.5 * (x1 + x2),
    y = 0.5 * (y1 + y2),
    length = Math.min(0.6 * depth, AXIS_MAX_PX * px),
    head = Math.min(8 * px, 0.3 * length);
  const tipX = x + length * dx,
    tipY = y + length * dy;
  ctx.setLineDash([]);
  ctx.lineWidth = 2 * px;
  ctx.beginPath();
  ctx.moveTo(x, y);
  ctx.lineTo(tipX, tipY);
  ctx.moveTo(tipX - head * (dx + dy), tipY - head * (dy - dx));
  ctx.lineTo(tipX, tipY);
  ctx.lineTo(tipX - head * (dx - dy), tipY - head * (dy + dx));
  ctx.stroke();
  const at = f.view.toScreen(x + 0.75 * depth * dx, y + 0.75 * depth * dy);
  f.onScreen();
  ctx.font = theme.font(11, 600);
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  const text = `dead end, ${f.units.length(depth, 1)} deep, ${percent(probability)}`,
    half = 0.5 * ctx.measureText(text).width;
  f.labels.push([at[0] - half, at[1] - 7, at[0] + half, at[1] + 7]);
  textWithHalo(f, text, at[0], at[1], theme.stop);
}
