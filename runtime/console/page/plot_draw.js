// @ts-check
// What a plot draws: the axes of time and values, and the line.

import { ticks } from "./plot_time.js";

export const LEFT = 46;
export const FOOT = 14; // the time below a lane
const GAP_S = 2.5; // a line is broken where frames are missing

/**
 * @param {CanvasRenderingContext2D} ctx @param {Theme} theme @param {Span} span
 * @param {(t: number) => number} x @param {number} height
 */
export function timeAxis(ctx, theme, span, x, height) {
  ctx.font = theme.font(10);
  ctx.textAlign = "center";
  ctx.textBaseline = "bottom";
  ctx.lineWidth = 1;
  for (const [t, text] of ticks(span)) {
    ctx.strokeStyle = theme.line;
    ctx.beginPath();
    ctx.moveTo(Math.round(x(t)) + 0.5, 0);
    ctx.lineTo(Math.round(x(t)) + 0.5, height - FOOT);
    ctx.stroke();
    ctx.fillStyle = theme.muted;
    ctx.fillText(text, Math.min(x(t), ctx.canvas.clientWidth - 14), height);
  }
}

/**
 * @param {CanvasRenderingContext2D} ctx @param {Theme} theme
 * @param {(value: number) => number} y @param {number[]} marks
 * @param {{ right: boolean; width: number; colour: string }} how
 */
export function valueAxis(ctx, theme, y, marks, { right, width, colour }) {
  ctx.font = theme.font(10.5);
  ctx.textAlign = right ? "left" : "right";
  ctx.textBaseline = "middle";
  ctx.lineWidth = 1;
  const least = 1e-9 * Math.max(...marks.map(Math.abs)); // below are rounding errors of a zero
  for (const mark of marks) {
    const at = Math.round(y(mark)) + 0.5;
    if (!right) {
      ctx.strokeStyle = theme.line;
      ctx.beginPath();
      ctx.moveTo(LEFT, at);
      ctx.lineTo(width, at);
      ctx.stroke();
    }
    ctx.fillStyle = right ? colour : theme.muted;
    ctx.fillText(digits(Math.abs(mark) < least ? 0 : mark), right ? width + 5 : LEFT - 5, at);
  }
}

/**
 * @param {TimedValue[]} points @param {(t: number) => number} x @param {(value: number) => number} y
 * @param {boolean} isAngle
 */
export function linePath(points, x, y, isAngle) {
  const path = new Path2D();
  let before = /** @type {Pair | null} */ (null);
  for (const [t, value] of points) {
    const broken =
      before === null || value === null || t - before[0] > GAP_S || (isAngle && Math.abs(value - before[1]) > 180);
    if (value !== null && broken) path.moveTo(x(t), y(value));
    else if (value !== null) path.lineTo(x(t), y(value));
    before = value === null ? null : [t, value];
  }
  return path;
}

// A little more than the values take; a constant has room around it.
/** @param {number[]} values */
export function bounds(values) {
  const low = Math.min(...values),
    high = Math.max(...values);
  if (values.length === 0) return [0, 1];
  return high > low ? [low - 0.04 * (high - low), high + 0.04 * (high - low)] : [low - 0.5, high + 0.5];
}

/** @param {number} value */
export function digits(value) {
  const size = Math.abs(value);
  const text =
    size >= 1000
      ? value.toFixed(0)
      : size >= 100
        ? value.toFixed(1)
        : size >= 1 || size === 0
          ? value.toFixed(2)
          : value.toPrecision(2);
  return (Number(text) === 0 ? "0" : text).replace("-", "−");
}
