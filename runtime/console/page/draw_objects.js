// @ts-check
// What was recognised: the model's outline with its label and probability, the 95 % ellipse of its place, the clusters
// it grew from, and for the one that is picked the readings that speak for and against it.

import { addArc, ellipseArc } from "./cross_paths.js";
import { addCross, addLine, textWithHalo, overlap } from "./scene.js";
import { percent } from "./units.js";
import { isWall } from "./walls.js";

const CHI2_95 = 5.991;
const SURE = 0.8; // below this the outline is dashed
const MAGNIFIED_MAX_M = 0.3; // a longer half axis would look like a wall

/** @param {Drawing} f */
export function drawClusters(f) {
  const { ctx, px, theme } = f;
  const path = new Path2D();
  for (const [x, y, length, width, angle, , cx = x, cy = y] of f.run.state.clusters) {
    const c = Math.cos(angle),
      s = Math.sin(angle);
    /** @param {number} a @param {number} b @returns {Pair} */
    const corner = (a, b) => [
      x + (a * c * length) / 2 - (b * s * width) / 2,
      y + (a * s * length) / 2 + (b * c * width) / 2,
    ];
    addLine(path, [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)]);
    path.closePath();
    addCross(path, cx, cy, 6 * px);
  }
  f.inWorld();
  ctx.strokeStyle = theme.cluster;
  ctx.lineWidth = 1.2 * px;
  ctx.stroke(path);
  if (f.view.scale < 70) return;
  f.onScreen();
  ctx.font = theme.font(11, 600);
  ctx.textAlign = "center";
  for (const [x, y, , , , count, cx = x, cy = y] of f.run.state.clusters) {
    const [sx, sy] = f.view.toScreen(cx, cy);
    textWithHalo(f, String(Math.round(count)), sx + 14, sy + 4, theme.cluster);
  }
}

// The outline of a model as it stands somewhere; a lozenge where there is no such model here.
/**
 * @param {Path2D} path @param {ModelRow | null} model @param {Pose & { covariance?: Triple | null }} pose
 * @param {number} px
 */
export function outlinePath(path, model, { x, y, theta, covariance = null }, px) {
  if (!model) {
    const r = 9 * px;
    path.moveTo(x + r, y);
    path.lineTo(x, y + r);
    path.lineTo(x - r, y);
    path.lineTo(x, y - r);
    path.closePath();
    return;
  }
  if (model.arc_radius_m && (model.closed || covariance !== null)) {
    // the Bayesian method locates circles, the paper's chords
    path.moveTo(x + model.arc_radius_m, y);
    path.arc(x, y, model.arc_radius_m, 0, 2 * Math.PI);
    return;
  }
  const c = Math.cos(theta),
    s = Math.sin(theta);
  addLine(
    path,
    model.vertices.map(([vx, vy]) => [x + c * vx - s * vy, y + s * vx + c * vy]),
  );
  if (model.closed) path.closePath();
}

/** @param {Triple | Quad} covariance */
export function ellipseOf(covariance) {
  const [xx, xy, yy] = covariance;
  const mean = (xx + yy) / 2,
    off = Math.hypot((xx - yy) / 2, xy);
  return {
    major: Math.sqrt(CHI2_95 * Math.max(mean + off, 0)),
    minor: Math.sqrt(CHI2_95 * Math.max(mean - off, 0)),
    angle: Math.atan2(2 * xy, xx - yy) / 2,
  };
}

// What an operator has said counts more than a number; behind a wall no reading checks the number.
/** @param {ShownObject} object */
export function certainty(object) {
  if (object.hidden_by !== null && !object.confirmed) return "hidden";
  if (object.placed && !object.confirmed) return "placed";
  return `${object.confirmed ? "✓ " : ""}${percent(object.probability ?? object.score)}`;
}

/** @param {Drawing} f */
export function drawAreas(f) {
  const { ctx, run, theme, px } = f;
  const path = new Path2D();
  for (const [, x, y, radius] of run.state.areas) {
    path.moveTo(x + radius, y);
    path.arc(x, y, radius, 0, 2 * Math.PI);
    addCross(path, x, y, radius * Math.SQRT1_2);
  }
  f.inWorld();
  ctx.strokeStyle = theme.muted;
  ctx.lineWidth = 1.2 * px;
  ctx.setLineDash([2 * px, 4 * px]);
  ctx.stroke(path);
}

/** @param {Drawing} f */
export function drawModels(f) {
  const { ctx, run, theme, px, selection } = f;
  const sure = new Path2D(),
    unsure = new Path2D(),
    picked = new Path2D();
  const walls = new Path2D(),
    unsureWalls = new Path2D();
  for (const object of run.state.objects) {
    const isSure = (object.probability ?? object.score) >= SURE && object.hidden_by === null;
    const isPicked = object.number !== null && object.number === selection.object;
    if (isWall(object)) {
      const [x1, y1, x2, y2] = object.ends;
      for (const path of [isSure ? walls : unsureWalls, isPicked ? picked : null]) {
        path?.moveTo(x1, y1);
        path?.lineTo(x2, y2);
      }
      continue;
    }
    const model = run.model(object.model);
    outlinePath(isSure ? sure : unsure, model, object, px);
    if (isPicked) outlinePath(picked, model, object, px);
  }
  f.inWorld();
  ctx.strokeStyle = theme.ink;
  ctx.lineWidth = 10 * px;
  ctx.stroke(picked);
  ctx.strokeStyle = theme.chosen;
  ctx.lineWidth = 7 * px;
  ctx.stroke(picked);
  ctx.globalAlpha = 0.3;
  ctx.fillStyle = theme.modelFill;
  ctx.fill(sure);
  ctx.globalAlpha = 1;
  ctx.strokeStyle = theme.model;
  ctx.lineWidth = 2 * px;
  ctx.stroke(sure);
  ctx.lineWidth = 4 * px;
  ctx.stroke(walls);
  ctx.setLineDash([6 * px, 4 * px]);
  ctx.stroke(unsureWalls);
  ctx.lineWidth = 2 * px;
  ctx.stroke(unsure);
}

/** @param {Drawing} f */
export function drawOutlines(f) {
  const { ctx, run, theme, px } = f;
  const sure = new Path2D(),
    unsure = new Path2D();
  for (const { points, probability } of run.polylines) addLine(probability >= SURE ? sure : unsure, points);
  f.inWorld();
  ctx.strokeStyle = theme.model;
  ctx.lineWidth = 1.5 * px;
  ctx.stroke(sure);
  ctx.setLineDash([6 * px, 4 * px]);
  ctx.stroke(unsure);
}

/** @param {Drawing} f */
export function drawEllipses(f) {
  const { ctx, run, theme, px } = f;
  const times = f.options.ellipseScale;
  const path = new Path2D(),
    magnified = new Path2D(),
    centres = new Path2D();
  for (const object of run.state.objects) {
    if (isWall(object)) continue; // the covariance of a wall's place is its length
    const { x, y, covariance } = object;
    const arm = 3.5 * px;
    centres.moveTo(x - arm, y);
    centres.lineTo(x + arm, y);
    centres.moveTo(x, y - arm);
    centres.lineTo(x, y + arm);
    if (!covariance) continue;
    const { major, minor, angle } = ellipseOf(covariance);
    const drawn = times * major > MAGNIFIED_MAX_M ? 1 : times;
    const to = drawn === 1 ? path : magnified;
    to.moveTo(x + drawn * major * Math.cos(angle), y + drawn * major * Math.sin(angle));
    to.ellipse(x, y, drawn * major, drawn * minor, angle, 0, 2 * Math.PI);
  }
  f.inWorld();
  ctx.strokeStyle = theme.ellipse;
  ctx.lineWidth = 1.4 * px;
  ctx.stroke(centres);
  ctx.lineWidth = 1.8 * px;
  ctx.stroke(path);
  ctx.lineCap = "round";
  ctx.setLineDash([0.1 * px, 3.5 * px]);
  ctx.stroke(magnified);
}

// Labels look for a place of their own, within the outline first, and are only a number where none is free.
/** @param {Drawing} f */
export function drawLabels(f) {
  const { ctx, run, theme, view } = f;
  f.onScreen();
  ctx.textBaseline = "middle";
  const spots = run.state.objects
    .map((object) => {
      const [x, y] = view.toScreen(object.x, object.y);
      return { object, x, y, r: Math.max(6, (run.model(object.model)?.arc_radius_m ?? 0.1) * view.scale) };
    })
    .filter(({ x, y }) => x > -50 && y > -50 && x < view.width + 50 && y < view.height + 50);
  const taken = f.labels;
  const [rx, ry] = view.toScreen(run.state.pose[0], run.state.pose[1]);
  const robot = { x: rx, y: ry, r: (run.session?.body?.radius ?? 0.2) * view.scale };
  /** @param {{ x: number; y: number; r: number }} spot @param {Quad} box */
  const misses = ({ x, y, r }, [left, top, right, bottom]) =>
    Math.hypot(x - Math.max(left, Math.min(x, right)), y - Math.max(top, Math.min(y, bottom))) > r;
  /** @param {Quad} box @param {object} own */
  const free = (box, own) =>
    taken.every((one) => !overlap(one, box)) &&
    misses(robot, box) &&
    spots.every((spot) => spot === own || misses(spot, box));
  for (const spot of spots) {
    const { object, x, y, r } = spot;
    const numbered = object.number !== null;
    const text = `${numbered ? `${object.number} ` : ""}${object.model}  ${certainty(object)}`;
    ctx.font = theme.font(12, 650);
    const half = ctx.measureText(text).width / 2;
    const inside = Math.hypot(half, 0.45 * r + 8) < r ? [[x, y - 0.45 * r]] : [];
    const places = [...inside, [x, y + r + 11], [x, y - r - 11], [x + r + 6 + half, y], [x - r - 6 - half, y]];
    const place = places.find(([tx, ty]) => free([tx - half - 2, ty - 8, tx + half + 2, ty + 8], spot));
    ctx.textAlign = "center";
    if (place) {
      const [tx, ty] = place;
      taken.push([tx - half - 2, ty - 8, tx + half + 2, ty + 8]);
      textWithHalo(f, text, tx, ty, theme.model);
    } else if (numbered) {
      ctx.font = theme.font(11, 650);
      textWithHalo(f, String(object.number), x, r > 14 ? y - 0.5 * r : y, theme.model);
    }
  }
}

// Readings for an object are whole arcs, those against it are dashed and crossed out in the middle.
/** @param {Drawing} f */
export function drawEvidence(f) {
  const { ctx, run, theme, px, selection } = f;
  const evidence = run.evidence;
  if (!evidence || evidence.object !== selection.object) return;
  const half = run.session?.ring?.half_angle ?? 0;
  const speaks = new Path2D(),
    against = new Path2D(),
    crosses = new Path2D(),
    rays = new Path2D();
  const reachMax = run.session?.ring?.range_max ?? 0;
  for (const { x1, y1, x2, y2, supports } of evidence.lines) {
    const path = supports ? speaks : against;
    path.moveTo(x1, y1);
    path.lineTo(x2, y2);
    if (!supports) addCross(crosses, (x1 + x2) / 2, (y1 + y2) / 2, 4 * px);
  }
  for (const {
    x,
    y,
    range: heard,
    angle,
    nats,
    listener: [lx, ly],
  } of evidence.readings) {
    const range = heard ?? reachMax; // without an echo: anything up to this range would have been heard
    const path = nats < 0 ? against : speaks;
    if (lx !== undefined) {
      const arc = ellipseArc(
        { transmitter: { x, y, angle }, listener: { x: lx, y: ly, angle: null }, half: range },
        half,
      );
      if (arc !== null) addArc(path, arc);
      continue;
    }
    path.moveTo(x + range * Math.cos(angle - half), y + range * Math.sin(angle - half));
    path.arc(x, y, range, angle - half, angle + half);
    rays.moveTo(x, y);
    rays.lineTo(x + range * Math.cos(angle), y + range * Math.sin(angle));
    if (nats < 0) addCross(crosses, x + range * Math.cos(angle), y + range * Math.sin(angle), 4 * px);
  }
  f.inWorld();
  ctx.strokeStyle = theme.muted;
  ctx.globalAlpha = 0.22;
  ctx.lineWidth = px;
  ctx.stroke(rays);
  ctx.globalAlpha = 0.85;
  ctx.strokeStyle = theme.model;
  ctx.lineWidth = 1.4 * px;
  ctx.stroke(speaks);
  ctx.strokeStyle = theme.stop;
  ctx.lineWidth = 2 * px;
  ctx.stroke(crosses);
  ctx.setLineDash([5 * px, 4 * px]);
  ctx.stroke(against);
}
