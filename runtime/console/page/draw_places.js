// @ts-check
// The layer of places: flags with names, no-go lines and hatched no-go areas, speed areas with their limit.

import { cornersOf } from "./places.js";
import { addLine, textWithHalo } from "./scene.js";
import { radians } from "./units.js";

const HATCH_PX = 9;
export const PIN_PX = 8;

/** @param {Drawing} f */
export function drawPlaces(f) {
  const { ctx, run, theme, view } = f;
  const { places } = run;
  if (!places || (!places.frameIsKnown && !run.state.localized)) return;
  /** @param {AreaRow} row */
  const onScreen = (row) =>
    cornersOf(row).flatMap((corner) => {
      const at = places.inPlane(corner);
      return at === null ? [] : [view.toScreen(at[0], at[1])];
    });
  /** @param {PlaceKind} kind @param {number} i */
  const isSelected = (kind, i) => places.selected?.[0] === kind && places.selected[1] === i;
  f.onScreen();
  ctx.globalAlpha = places.frameIsKnown ? 1 : 0.45;
  for (const [i, row] of places.all.speed_area.entries()) {
    const points = onScreen(row);
    outline(ctx, points, true);
    ctx.fillStyle = ctx.strokeStyle = theme.warning;
    fillFaintly(ctx, 0.12);
    ctx.setLineDash([6, 4]);
    stroke(ctx, isSelected("speed_area", i) ? 3 : 1.5);
    ctx.setLineDash([]);
    const limit = `≤ ${f.units.number(row.speed_max_m_s)} ${f.units.name}/s`;
    label(f, points, `${row.name ? `${row.name} ` : ""}${limit}`, theme.warning);
  }
  for (const [i, row] of places.all.no_go_area.entries()) {
    const points = onScreen(row);
    outline(ctx, points, true);
    ctx.fillStyle = ctx.strokeStyle = theme.stop;
    fillFaintly(ctx, 0.1);
    hatch(ctx, points);
    outline(ctx, points, true);
    stroke(ctx, isSelected("no_go_area", i) ? 3.5 : 2);
    label(f, points, row.name || "no-go", theme.stop);
  }
  for (const [i, row] of places.all.no_go_line.entries()) {
    const points = onScreen(row);
    outline(ctx, points, false);
    ctx.strokeStyle = theme.stop;
    stroke(ctx, isSelected("no_go_line", i) ? 5 : 3);
    if (row.name) label(f, points, row.name, theme.stop);
  }
  for (const [i, row] of places.all.place.entries()) drawPlace(f, places, row, isSelected("place", i));
  ctx.globalAlpha = 1;
}

/** @param {Drawing} f @param {Places} places @param {PlaceConfig} row @param {boolean} isSelected */
function drawPlace(f, places, row, isSelected) {
  const { ctx, theme, view } = f;
  const at = places.inPlane([row.x_m, row.y_m], radians(row.heading_deg));
  if (at === null) return;
  const [x, y, heading] = at;
  const [sx, sy] = view.toScreen(x, y);
  ctx.strokeStyle = theme.drive;
  if (heading !== null) {
    ctx.beginPath();
    ctx.moveTo(sx, sy);
    ctx.lineTo(sx + 2.4 * PIN_PX * Math.cos(heading), sy - 2.4 * PIN_PX * Math.sin(heading));
    stroke(ctx, 3);
  }
  ctx.beginPath();
  ctx.rect(sx - PIN_PX / 1.4, sy - PIN_PX / 1.4, 1.43 * PIN_PX, 1.43 * PIN_PX);
  ctx.fillStyle = isSelected ? theme.accent : theme.paper;
  ctx.fill();
  stroke(ctx, 2);
  ctx.font = f.theme.font(12, 650);
  ctx.textAlign = "center";
  // Below it, where the flag of a goal is not, unless its heading points there.
  const side = heading !== null && Math.sin(heading) < -0.3 ? -1 : 1;
  ctx.textBaseline = side < 0 ? "bottom" : "top";
  textWithHalo(f, row.name, sx, sy + side * (PIN_PX + 2), theme.drive);
}

/** @param {CanvasRenderingContext2D} ctx @param {Pair[]} points @param {boolean} isClosed */
function outline(ctx, points, isClosed) {
  ctx.beginPath();
  addLine(ctx, points);
  if (isClosed) ctx.closePath();
}

/** @param {CanvasRenderingContext2D} ctx @param {number} width */
function stroke(ctx, width) {
  ctx.lineWidth = width;
  ctx.stroke();
}

/** @param {CanvasRenderingContext2D} ctx @param {number} alpha */
function fillFaintly(ctx, alpha) {
  const { globalAlpha } = ctx;
  ctx.globalAlpha = alpha * globalAlpha;
  ctx.fill("evenodd");
  ctx.globalAlpha = globalAlpha;
}

// Diagonal lines inside the outline that is the context's path.
/** @param {CanvasRenderingContext2D} ctx @param {Pair[]} points */
function hatch(ctx, points) {
  const xs = points.map(([x]) => x),
    ys = points.map(([, y]) => y);
  const left = Math.max(0, Math.min(...xs)),
    right = Math.min(4000, Math.max(...xs));
  const top = Math.max(0, Math.min(...ys)),
    bottom = Math.min(4000, Math.max(...ys));
  if (right <= left || bottom <= top) return;
  ctx.save();
  ctx.clip("evenodd");
  ctx.beginPath();
  for (let at = left - (bottom - top); at < right; at += HATCH_PX) {
    ctx.moveTo(at, bottom);
    ctx.lineTo(at + bottom - top, top);
  }
  stroke(ctx, 0.8);
  ctx.restore();
}

/** @param {Drawing} f @param {Pair[]} points @param {string} text @param {string} colour */
function label(f, points, text, colour) {
  const x = points.reduce((sum, point) => sum + point[0], 0) / points.length;
  const y = points.reduce((sum, point) => sum + point[1], 0) / points.length;
  f.ctx.font = f.theme.font(11.5, 650);
  f.ctx.textAlign = "center";
  f.ctx.textBaseline = "middle";
  textWithHalo(f, text, x, y, colour);
}
