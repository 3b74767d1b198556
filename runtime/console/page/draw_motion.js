// @ts-check
// The robot and what moves it: body and heading, the trail, each schema's vector with its name, their sum, the goal.

import { ellipseOf } from "./draw_objects.js";
import { ofPlane } from "./map_frame.js";
import { addHeading, addLine, pairOf, textWithHalo, overlap } from "./scene.js";
import { magnitude } from "./units.js";

const UNIT_PX = 70; // a vector of magnitude one; longer where the robot is large, so that it shows beyond the rim
const LENGTH_MAX = 2; // in units
const AXIS_PX = 40;
const DASHES = [
  [7, 4],
  [2, 3],
  [10, 3, 2, 3],
  [4, 6],
];

/** @returns {(f: Drawing) => void} */
export function trailDrawer() {
  let version = -1;
  let path = new Path2D();
  return (f) => {
    const { ctx, run, px, theme } = f;
    if (run.trailVersion !== version) {
      version = run.trailVersion;
      path = new Path2D();
      addLine(path, run.trail.map(pairOf));
    }
    f.inWorld();
    ctx.strokeStyle = theme.robot;
    ctx.lineJoin = "round";
    ctx.lineWidth = 2 * px;
    ctx.globalAlpha = 0.8;
    ctx.stroke(path);
  };
}

// The way as it is known now, which lies in the map frame: its path to where the robot is, the ellipses of its maps, and
// the loop closures.
/** @param {Drawing} f */
export function drawKnownWay(f) {
  const { ctx, run, px, theme } = f,
    { path, maps, loops } = run.knownWay;
  if (!run.fresh || run.state.localized === null || path.length === 0) return;
  const { frame } = run.state.localized;
  const line = new Path2D(),
    ellipses = new Path2D(),
    closures = new Path2D();
  addLine(line, [...path, ofPlane(frame, run.state.pose[0], run.state.pose[1])]);
  for (const [x, y, ...covariance] of maps) {
    const { major, minor, angle } = ellipseOf(covariance);
    if (!(major > 0)) continue; // the first map is where it is
    ellipses.moveTo(x + major * Math.cos(angle), y + major * Math.sin(angle));
    ellipses.ellipse(x, y, major, minor, angle, 0, 2 * Math.PI);
  }
  for (const [x1, y1, x2, y2] of loops)
    addLine(closures, [
      [x1, y1],
      [x2, y2],
    ]);
  f.inWorld();
  ctx.translate(frame[0], frame[1]);
  ctx.rotate(frame[2]);
  ctx.strokeStyle = theme.ellipse;
  ctx.lineWidth = px;
  ctx.stroke(ellipses);
  ctx.strokeStyle = theme.ink;
  ctx.lineJoin = "round";
  ctx.lineWidth = 1.5 * px;
  ctx.stroke(line);
  ctx.strokeStyle = theme.cluster;
  ctx.lineWidth = 1.5 * px;
  ctx.stroke(closures);
}

/** @param {Drawing} f */
export function drawRobot(f) {
  const { ctx, run, px, theme } = f;
  if (!run.fresh) return;
  const [x, y, theta] = run.state.pose;
  const r = run.session?.body?.radius ?? 0.2;
  f.inWorld();
  ctx.beginPath();
  ctx.arc(x, y, r, 0, 2 * Math.PI);
  ctx.fillStyle = theme.robotFill;
  ctx.globalAlpha = 0.8;
  ctx.fill();
  ctx.globalAlpha = 1;
  ctx.strokeStyle = theme.robot;
  ctx.lineWidth = 2.5 * px;
  ctx.stroke();
  addHeading(ctx, x, y, theta, r);
  ctx.fillStyle = theme.robot;
  ctx.fill();
  const yaw = run.state.ring_yaw; // the ring does not turn with the wheels: its own mark, on the rim
  ctx.beginPath();
  ctx.moveTo(x + 0.86 * r * Math.cos(yaw), y + 0.86 * r * Math.sin(yaw));
  ctx.lineTo(x + 1.12 * r * Math.cos(yaw), y + 1.12 * r * Math.sin(yaw));
  ctx.lineWidth = 4 * px;
  ctx.stroke();
}

// The surfaces of the known room, where the robot's place has them; dashed while it does not track.
/** @param {Drawing} f @param {SurfacesRow} room @param {LocalizedRow} localized */
function drawKnownRoom({ ctx, px, theme }, { drums, walls, polygons }, { frame, status }) {
  const [x, y, turn] = frame,
    lines = new Path2D();
  for (const [x1, y1, x2, y2] of walls) {
    lines.moveTo(x1, y1);
    lines.lineTo(x2, y2);
  }
  for (const polygon of polygons) {
    addLine(lines, polygon);
    lines.closePath();
  }
  for (const [cx, cy, r] of drums) {
    lines.moveTo(cx + r, cy);
    lines.arc(cx, cy, r, 0, 2 * Math.PI);
  }
  ctx.save();
  ctx.translate(x, y);
  ctx.rotate(turn);
  ctx.strokeStyle = theme.drive;
  ctx.lineWidth = 1.2 * px;
  ctx.setLineDash(status === "tracking" ? [] : [4 * px, 5 * px]);
  ctx.stroke(lines);
  ctx.restore();
}

// The axes of the map frame, which lies askew in odometry's where odometry has drifted, and the ellipse of the robot's
// place.
/** @param {Drawing} f */
export function drawMapFrame(f) {
  const { ctx, run, px, theme } = f;
  if (!run.fresh || run.state.localized === null) return;
  const {
    frame: [x, y, turn],
    covariance,
  } = run.state.localized;
  const length = AXIS_PX * px;
  f.inWorld();
  if (run.session?.known_room) drawKnownRoom(f, run.session.known_room, run.state.localized);
  ctx.strokeStyle = theme.drive;
  ctx.lineWidth = 2 * px;
  ctx.beginPath();
  ctx.moveTo(x + length * Math.cos(turn), y + length * Math.sin(turn));
  ctx.lineTo(x, y);
  ctx.lineTo(x - length * Math.sin(turn), y + length * Math.cos(turn));
  ctx.stroke();
  if (covariance !== null) {
    const { major, minor, angle } = ellipseOf(covariance),
      times = f.options.ellipseScale;
    ctx.beginPath();
    ctx.ellipse(run.state.pose[0], run.state.pose[1], times * major, times * minor, angle + turn, 0, 2 * Math.PI);
    ctx.stroke();
  }
  const at = f.view.toScreen(x, y);
  f.onScreen();
  ctx.font = theme.font(11, 600);
  ctx.textAlign = "left";
  textWithHalo(f, "map", at[0] + 5, at[1] - 5, theme.drive);
}

/**
 * @param {CanvasRenderingContext2D} ctx @param {number} x @param {number} y @param {number} dx @param {number} dy
 * @param {number} head
 */
function arrow(ctx, x, y, dx, dy, head) {
  const length = Math.hypot(dx, dy),
    ux = dx / length,
    uy = dy / length;
  ctx.beginPath();
  ctx.moveTo(x, y);
  ctx.lineTo(x + dx - ux * head, y + dy - uy * head);
  ctx.stroke();
  ctx.setLineDash([]);
  ctx.beginPath();
  ctx.moveTo(x + dx, y + dy);
  ctx.lineTo(x + dx - ux * head - uy * head * 0.5, y + dy - uy * head + ux * head * 0.5);
  ctx.lineTo(x + dx - ux * head + uy * head * 0.5, y + dy - uy * head - ux * head * 0.5);
  ctx.closePath();
  ctx.fill();
}

/** @param {Drawing} f */
export function drawVectors(f) {
  const { ctx, run, theme, view } = f;
  if (!run.fresh) return;
  const [x, y] = view.toScreen(run.state.pose[0], run.state.pose[1]);
  f.onScreen();
  ctx.textBaseline = "middle";
  const unit = Math.max(UNIT_PX, 1.7 * (run.session?.body?.radius ?? 0) * view.scale);
  const roomy = view.width > 480;
  run.state.vectors.forEach(([name, vx, vy], i) => {
    const size = Math.hypot(vx, vy);
    if (!(size > 0.01)) return;
    const length = Math.min(size, LENGTH_MAX) * unit;
    const dx = (vx / size) * length,
      dy = (-vy / size) * length;
    const sum = name === "sum";
    ctx.strokeStyle = ctx.fillStyle = sum ? theme.ink : theme.vector;
    ctx.lineWidth = sum ? 3.5 : 2;
    ctx.setLineDash(sum ? [] : DASHES[i % DASHES.length]);
    arrow(ctx, x, y, dx, dy, Math.min(sum ? 13 : 10, length));
    ctx.font = theme.font(roomy ? 11.5 : 10, sum ? 700 : 600);
    ctx.textAlign = "left";
    const text = `${name.replaceAll("_", "-")}${roomy ? ` ${magnitude(size)}` : ""}`;
    const width = ctx.measureText(text).width;
    const tx = Math.max(4, Math.min(view.width - width - 4, dx >= 0 ? x + dx + 7 : x + dx - 7 - width));
    let ty = y + dy + (sum ? 0 : dy > 0 ? 8 : -8);
    /** @returns {Quad} */
    const box = () => [tx - 2, ty - 7, tx + width + 2, ty + 7];
    while (f.labels.some((taken) => overlap(taken, box()))) ty += 13;
    f.labels.push(box());
    textWithHalo(f, text, tx, ty, sum ? theme.ink : theme.vector);
  });
}

// The way that the look-ahead has found, and on a ring round the robot the directions in which something stands.
/** @param {Drawing} f */
export function drawValley(f) {
  const { ctx, run, px, theme } = f,
    valley = run.state.valley;
  if (!run.fresh || !valley) return;
  const [x, y] = run.state.pose,
    r = 1.35 * (run.session?.body?.radius ?? 0.2);
  const sector = (2 * Math.PI) / valley.blocked.length;
  f.inWorld();
  ctx.strokeStyle = theme.stop;
  ctx.globalAlpha = 0.7;
  ctx.lineWidth = 3 * px;
  ctx.beginPath();
  [...valley.blocked].forEach((flag, k) => {
    if (flag !== "1") return;
    const begin = (k - 0.5) * sector;
    ctx.moveTo(x + r * Math.cos(begin), y + r * Math.sin(begin));
    ctx.arc(x, y, r, begin, begin + sector);
  });
  ctx.stroke();
  ctx.strokeStyle = theme.drive;
  ctx.lineWidth = 2 * px;
  ctx.beginPath();
  addLine(ctx, valley.way);
  ctx.stroke();
  ctx.globalAlpha = 1;
}

/** @param {Drawing} f */
export function drawGoal(f) {
  const { ctx, run, theme, view } = f;
  const drive_request = run.state.drive_request;
  if (drive_request?.kind !== "goal") return;
  const at = drive_request.frame === "map" ? drive_request.at : [drive_request.x, drive_request.y];
  if (!at) return; // a goal in the map, and the robot's place there is not known
  const [x, y] = view.toScreen(at[0], at[1]);
  const [rx, ry] = view.toScreen(run.state.pose[0], run.state.pose[1]);
  f.onScreen();
  ctx.strokeStyle = ctx.fillStyle = theme.drive;
  ctx.lineWidth = 1.5;
  ctx.setLineDash([3, 5]);
  ctx.beginPath();
  ctx.moveTo(rx, ry);
  ctx.lineTo(x, y);
  ctx.stroke();
  ctx.setLineDash([]);
  ctx.lineWidth = 2.5;
  ctx.beginPath();
  ctx.moveTo(x, y);
  ctx.lineTo(x, y - 26);
  ctx.stroke();
  ctx.beginPath();
  ctx.moveTo(x, y - 26);
  ctx.lineTo(x + 18, y - 20);
  ctx.lineTo(x, y - 14);
  ctx.closePath();
  ctx.fill();
  ctx.beginPath();
  ctx.arc(x, y, 4, 0, 2 * Math.PI);
  ctx.fill();
  if (drive_request.heading !== null) {
    const heading = drive_request.heading + (drive_request.frame === "map" ? (run.state.localized?.frame[2] ?? 0) : 0);
    ctx.lineWidth = 3;
    ctx.beginPath();
    ctx.moveTo(x, y);
    ctx.lineTo(x + 24 * Math.cos(heading), y - 24 * Math.sin(heading));
    ctx.stroke();
  }
  ctx.font = theme.font(12, 650);
  ctx.textAlign = "left";
  ctx.textBaseline = "middle";
  textWithHalo(f, "goal", x + 21, y - 20, theme.drive);
}
