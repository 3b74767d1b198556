// @ts-check
// Outline segments, the newer the bolder; pinned ones have square ends, selected ones a band behind them.

import { distanceToLine } from "./walls.js";

const AGES = [
  [2, 1, 2.8],
  [10, 0.85, 2.2],
  [30, 0.65, 1.8],
  [60, 0.5, 1.4],
  [Infinity, 0.36, 1.1],
]; // s, opacity, px

const OLD_S = Number.MAX_VALUE; // of a segment whose age is not known

export const AGE_LEGEND = "bold: new, thin: old";

// One path for all segments of like age: five strokes draw any number of them.
class Paths {
  key = "";
  /** @type {Path2D[]} */
  paths = [];
  /** @type {Segment[]} */
  pins = [];

  /** @param {RunState} run */
  refresh(run) {
    const key = `${run.segmentsVersion} ${Math.floor(run.state.robot_s)}`;
    if (key === this.key) return;
    this.key = key;
    this.paths = AGES.map(() => new Path2D());
    this.pins = [];
    for (const s of run.segments.values()) {
      const age = s.t === null ? OLD_S : run.state.robot_s - s.t;
      const path = this.paths[AGES.findIndex(([until]) => age < until)];
      path.moveTo(s.x1, s.y1);
      path.lineTo(s.x2, s.y2);
      if (s.pinned) this.pins.push(s);
    }
  }
}

/** @returns {(f: Drawing) => void} */
export function segmentsDrawer() {
  const cache = new Paths();
  return (f) => {
    const { ctx, run, px, theme, selection } = f;
    cache.refresh(run);
    f.inWorld();
    if (selection.segments.size > 0) {
      const chosen = new Path2D();
      for (const number of selection.segments) {
        const s = run.segments.get(number);
        if (s === undefined) continue;
        chosen.moveTo(s.x1, s.y1);
        chosen.lineTo(s.x2, s.y2);
      }
      ctx.lineCap = "round";
      ctx.strokeStyle = theme.ink;
      ctx.lineWidth = 11 * px;
      ctx.stroke(chosen);
      ctx.strokeStyle = theme.chosen;
      ctx.lineWidth = 8 * px;
      ctx.stroke(chosen);
      ctx.lineCap = "butt";
    }
    ctx.strokeStyle = theme.segment;
    cache.paths.forEach((path, i) => {
      ctx.globalAlpha = AGES[i][1];
      ctx.lineWidth = AGES[i][2] * px;
      ctx.stroke(path);
    });
    ctx.globalAlpha = 1;
    ctx.fillStyle = theme.segment;
    const side = 6 * px;
    for (const s of cache.pins) {
      ctx.fillRect(s.x1 - side / 2, s.y1 - side / 2, side, side);
      ctx.fillRect(s.x2 - side / 2, s.y2 - side / 2, side, side);
    }
  };
}

// The segment nearest to a point of the plane, within reach (m).
/** @param {RunState} run @param {number} x @param {number} y @param {number} reach */
export function nearestSegment(run, x, y, reach) {
  let best = /** @type {Segment | null} */ (null),
    nearest = reach;
  for (const s of run.segments.values()) {
    const away = distanceToLine([s.x1, s.y1, s.x2, s.y2], x, y);
    if (away < nearest) [best, nearest] = [s, away];
  }
  return best;
}
