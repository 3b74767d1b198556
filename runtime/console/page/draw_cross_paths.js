// @ts-check
// Cross paths: an arc of each path's ellipse, the newer the bolder, and a mark where a recognised object reflected it.

import { addArc, ellipseArc, reflectorOf } from "./cross_paths.js";
import { addLine } from "./scene.js";

const AGES = [
  [0.15, 0.8, 1.6],
  [0.5, 0.4, 1.2],
  [Infinity, 0.22, 1],
]; // up to s, opacity, px
const UNEXPLAINED = 0.4; // of that opacity, where no object explains the path
const MARK_PX = 4.5;
const MARK_EVERY_PX = 12; // one mark for all that lie as near together

// Each mark in a frame of its own: x towards the sensors, in units of MARK_PX.
/** @type {Record<string, Pair[]>} */
const MARKS = {
  wall: [
    [0, -1.6],
    [0, 1.6],
  ],
  corner: [
    [1, -1],
    [0, 0],
    [1, 1],
  ],
  edge: [
    [1, 0],
    [-1, 1],
    [-1, -1],
    [1, 0],
  ],
  outline: [
    [-1, -1],
    [1, -1],
    [1, 1],
    [-1, 1],
    [-1, -1],
  ],
};

/** @param {Drawing} f */
export function drawCrossPaths(f) {
  const { ctx, run, px, theme } = f;
  const explained = AGES.map(() => new Path2D()),
    others = AGES.map(() => new Path2D());
  const marks = new Path2D(),
    marked = new Set();
  for (const path of run.crossPaths) {
    if (path.arc === undefined) path.arc = ellipseArc(path, run.session?.ring.half_angle ?? 0);
    if (path.arc === null) continue;
    if (path.reflector === undefined) path.reflector = reflectorOf(path, run);
    const age = run.state.robot_s - path.t;
    const group = AGES.findIndex(([until]) => age < until);
    addArc((path.reflector ? explained : others)[group], path.arc);
    if (path.reflector === null) continue;
    const { kind, x, y } = path.reflector;
    const place = [kind, ...[x, y].map((metres) => Math.round(metres / (MARK_EVERY_PX * px)))].join(" ");
    if (!marked.has(place)) addMark(marks, path, path.reflector, MARK_PX * px);
    marked.add(place);
  }
  f.inWorld();
  ctx.strokeStyle = theme.cross;
  AGES.forEach(([, opacity, width], i) => {
    ctx.lineWidth = width * px;
    ctx.globalAlpha = opacity;
    ctx.stroke(explained[i]);
    ctx.globalAlpha = UNEXPLAINED * opacity;
    ctx.stroke(others[i]);
  });
  ctx.globalAlpha = 1;
  ctx.lineJoin = "round";
  ctx.strokeStyle = theme.map;
  ctx.lineWidth = 4 * px;
  ctx.stroke(marks);
  ctx.strokeStyle = theme.cross;
  ctx.lineWidth = 1.8 * px;
  ctx.stroke(marks);
}

/** @param {Path2D} marks @param {CrossPath} path @param {Reflector} reflector @param {number} size */
function addMark(marks, { transmitter: t, listener: l }, { kind, x, y }, size) {
  if (kind === "round") {
    marks.moveTo(x + size, y);
    marks.arc(x, y, size, 0, 2 * Math.PI);
    return;
  }
  const angle = Math.atan2((t.y + l.y) / 2 - y, (t.x + l.x) / 2 - x);
  const c = size * Math.cos(angle),
    s = size * Math.sin(angle);
  addLine(
    marks,
    MARKS[kind].map(([forward, left]) => [x + c * forward - s * left, y + s * forward + c * left]),
  );
}
