// @ts-check
// What a plot draws: the axes of time and values, and the line.

import { ticks } from "./plot_time.js";

export const LEFT = 46;
export const FOOT = 14; // the time below a lane
const GAP_S = 2.5; // a line is broken where frames are missing
const STEPS_MIN = 2; // of an axis of values, at least

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

// The values to mark between two, at steps of 1, 2 or 5 times a power of ten, with their texts.
/** @param {number} low @param {number} high @returns {Array<[number, string]>} */
export function valueMarks(low, high) {
  const rough = (high - low) / STEPS_MIN,
    power = Math.floor(Math.log10(rough));
  const step = (rough >= 5 * 10 ** power ? 5 : rough >= 2 * 10 ** power ? 2 : 1) * 10 ** power;
  /** @type {Array<[number, string]>} */
  const marks = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++)
    marks.push([k * step, (k * step).toFixed(Math.max(0, -power)).replace(/^-(0[.0]*$)?/, (_, zero) => zero ?? "−")]);
  return marks;
}

/**
 * @param {CanvasRenderingContext2D} ctx @param {Theme} theme
 * @param {(value: number) => number} y @param {Array<[number, string]>} marks
 * @param {{ right: boolean; width: number; colour: string }} how
 */
export function valueAxis(ctx, theme, y, marks, { right, width, colour }) {
  ctx.font = theme.font(10.5);
  ctx.textAlign = right ? "left" : "right";
  ctx.textBaseline = "middle";
  ctx.lineWidth = 1;
  for (const [mark, text] of marks) {
    const at = Math.round(y(mark)) + 0.5;
    if (!right) {
      ctx.strokeStyle = theme.line;
      ctx.beginPath();
      ctx.moveTo(LEFT, at);
      ctx.lineTo(width, at);
      ctx.stroke();
    }
    ctx.fillStyle = right ? colour : theme.muted;
    ctx.fillText(text, right ? width + 5 : LEFT - 5, at);
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
  const least = 1e-9 * Math.max(Math.abs(low), Math.abs(high)); // less are rounding errors
  return high - low > least ? [low - 0.04 * (high - low), high + 0.04 * (high - low)] : [low - 0.5, high + 0.5];
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
