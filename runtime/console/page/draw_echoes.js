// @ts-check
// Raw data: the beams that fire now, and the arcs on which recent echoes lie.

import { textWithHalo } from "./scene.js";

const AGES = [
  [0.3, 0.9, 1.8],
  [1.5, 0.45, 1.2],
  [Infinity, 0.2, 1],
]; // up to s, opacity, px

/** @param {Drawing} f */
export function drawArcs(f) {
  const { ctx, run, px } = f;
  const half = run.session?.ring?.half_angle ?? 0;
  const paths = AGES.map(() => new Path2D());
  for (const echo of run.echoes) {
    const age = run.state.robot_s - echo.t;
    const path = paths[AGES.findIndex(([until]) => age < until)];
    const from = echo.angle - half;
    path.moveTo(echo.x + echo.range * Math.cos(from), echo.y + echo.range * Math.sin(from));
    path.arc(echo.x, echo.y, echo.range, from, echo.angle + half);
  }
  f.inWorld();
  ctx.strokeStyle = f.theme.echo;
  paths.forEach((path, i) => {
    ctx.globalAlpha = AGES[i][1];
    ctx.lineWidth = AGES[i][2] * px;
    ctx.stroke(path);
  });
}

/** @param {Drawing} f */
export function drawBeams(f) {
  const { ctx, run, px, theme } = f;
  const ring = run.session?.ring;
  if (!ring) return;
  const heard = new Path2D(),
    unheard = new Path2D();
  /** @type {Array<[number, SensorPose]>} */
  const places = [];
  for (const index of run.state.firing) {
    const at = run.sensor(index);
    if (at === null) continue;
    const range = run.state.ranges[index];
    const echo = range !== null && range !== undefined && range >= 0;
    const reach = echo ? range : ring.range_max;
    const path = echo ? heard : unheard;
    path.moveTo(at.x, at.y);
    path.arc(at.x, at.y, reach, at.angle - ring.half_angle, at.angle + ring.half_angle);
    path.closePath();
    places.push([index, at]);
  }
  f.inWorld();
  ctx.fillStyle = theme.echo;
  ctx.globalAlpha = 0.16;
  ctx.fill(heard);
  ctx.globalAlpha = 0.04;
  ctx.fill(unheard);
  ctx.strokeStyle = theme.echo;
  ctx.globalAlpha = 0.75;
  ctx.lineWidth = px;
  ctx.stroke(heard);
  ctx.globalAlpha = 0.3;
  ctx.setLineDash([4 * px, 5 * px]);
  ctx.stroke(unheard);
  if (f.view.scale < 55) return;
  f.onScreen();
  ctx.globalAlpha = 1;
  ctx.font = theme.font(11, 650);
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  for (const [index, at] of places) {
    const [x, y] = f.view.toScreen(at.x + 0.1 * Math.cos(at.angle), at.y + 0.1 * Math.sin(at.angle));
    textWithHalo(f, String(index), x, y, theme.echo);
  }
}
