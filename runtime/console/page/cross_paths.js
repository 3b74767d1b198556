// @ts-check
// Cross paths: the way of sound from a sensor over a surface to one that listens. The surface touches an ellipse with
// both sensors as foci; which recognised object it is follows from the shortest way over each. Nothing here draws.

const SOUND_REACH = 2; // a sensor hears the pulse of another one this far off its axis, in half widths of its own beam
const GATE_M = 0.1; // an object explains a half path that differs by less from the way over it
const WALL_BEYOND_M = 0.1; // walls are known as far as they have answered
const BEAM_SLACK = 0.05; // rad

/** @typedef {{ half: number; x: number; y: number }} Way */

/** @param {number} angle */
const wrap = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));

// The part of a path's ellipse within both beams, as the arguments of Path2D.ellipse; null if the path is shorter than
// the sensors are apart. Where the beams do not meet on it, the part within the transmitter's beam and beside the
// listener's; `listener.angle` null: only the transmitter's beam counts.
/** @param {CrossPath} path @param {number} beam @returns {Arc | null} */
export function ellipseArc({ transmitter: t, listener: l, half }, beam) {
  const apart = Math.hypot(l.x - t.x, l.y - t.y),
    focus = apart / 2;
  if (half <= focus) return null;
  const across = Math.atan2(l.y - t.y, l.x - t.x);
  const side = Math.sqrt(half ** 2 - focus ** 2);
  // From a focus the ellipse is this far in a direction; `other` is the direction of the other focus.
  /** @param {number} direction @param {number} other */
  const reach = (direction, other) => side ** 2 / (half - focus * Math.cos(direction - other));
  let low = -beam,
    high = beam; // off the transmitter's axis
  const { angle } = l;
  for (const width of angle === null ? [] : [beam, SOUND_REACH * beam]) {
    const [from, to] = [-width, width].map((off) => {
      const direction = (angle ?? 0) + off,
        far = reach(direction, across + Math.PI);
      return wrap(Math.atan2(l.y + far * Math.sin(direction) - t.y, l.x + far * Math.cos(direction) - t.x) - t.angle);
    });
    if (Math.max(from, -beam) < Math.min(to, beam)) {
      [low, high] = [Math.max(from, -beam), Math.min(to, beam)];
      break;
    }
  }
  const [start, end] = [low, high].map((off) => {
    const direction = t.angle + off - across,
      far = reach(direction, 0);
    return Math.atan2((far * Math.sin(direction)) / side, (far * Math.cos(direction) - focus) / half);
  });
  return [(t.x + l.x) / 2, (t.y + l.y) / 2, half, side, across, start, end < start ? end + 2 * Math.PI : end];
}

/** @param {Path2D} path @param {Arc} arc */
export function addArc(path, arc) {
  const [x, y, a, b, turn, from] = arc;
  const along = a * Math.cos(from),
    up = b * Math.sin(from);
  path.moveTo(x + along * Math.cos(turn) - up * Math.sin(turn), y + along * Math.sin(turn) + up * Math.cos(turn));
  path.ellipse(...arc);
}

// The object that explains a cross path best: { object, kind, x, y } with the point that reflected it, null if none
// does.
/** @param {CrossPath} path @param {RunState} run @returns {Reflector | null} */
export function reflectorOf(path, run) {
  const { transmitter: t, listener: l, half } = path;
  const beam = run.session?.ring.half_angle ?? 0;
  /** @param {{ x: number; y: number; angle: number | null }} sensor @param {Point} point @param {number} width */
  const sees = (sensor, point, width) =>
    Math.abs(wrap(Math.atan2(point.y - sensor.y, point.x - sensor.x) - (sensor.angle ?? 0))) <= width + BEAM_SLACK;
  let best = /** @type {Reflector | null} */ (null),
    least = GATE_M;
  for (const object of run.state.objects) {
    if (object.hidden_by !== null) continue;
    for (const [kind, found] of waysOver(object, run, path)) {
      const off = Math.abs(found.half - half);
      if (off < least && sees(t, found, beam) && sees(l, found, SOUND_REACH * beam)) {
        [best, least] = [{ object, kind, x: found.x, y: found.y }, off];
      }
    }
  }
  return best;
}

// How an object may reflect a path: [kind, { half, x, y }] of each of its surfaces; none that cannot be near it.
/** @param {ShownObject} object @param {RunState} run @param {CrossPath} path @returns {Array<[string, Way]>} */
function waysOver(object, run, { transmitter: t, listener: l, half }) {
  if (object.ends) return overSide(t, l, object.ends, WALL_BEYOND_M).map((way) => ["wall", way]);
  if (object.model === "inside corner") return [["corner", overCorner(t, l, object)]];
  const model = run.model(object.model);
  if (model && !(model.arc_radius_m && (model.closed || object.covariance))) {
    const c = Math.cos(object.theta),
      s = Math.sin(object.theta);
    /** @type {Pair[]} */
    const at = model.vertices.map(([x, y]) => [object.x + c * x - s * y, object.y + s * x + c * y]);
    const sides = at.slice(0, model.closed ? at.length : -1);
    const ways = sides
      .flatMap((one, i) => overSide(t, l, [...one, ...at[(i + 1) % at.length]], 0))
      .sort((a, b) => a.half - b.half);
    return ways.slice(0, 1).map((way) => ["outline", way]);
  }
  const radius = model?.arc_radius_m ?? run.session?.radii?.[object.model];
  // The way over a circle differs from that over its centre by the radius at most.
  if (radius === undefined || Math.abs(way(t, l, object.x, object.y).half - half) > radius + GATE_M) return [];
  return [[radius === 0 ? "edge" : "round", overCircle(t, l, object, radius)]];
}

// A way with its point, half its length taken.
/** @param {Point} t @param {Point} l @param {number} x @param {number} y @returns {Way} */
function way(t, l, x, y) {
  return { half: (Math.hypot(x - t.x, y - t.y) + Math.hypot(x - l.x, y - l.y)) / 2, x, y };
}

// A right-angled corner mirrors twice: the sensors' middle and the corner are half a path apart.
/** @param {Point} t @param {Point} l @param {Point} corner @returns {Way} */
export function overCorner(t, l, { x, y }) {
  return { half: Math.hypot(x - (t.x + l.x) / 2, y - (t.y + l.y) / 2), x, y };
}

// The shortest way over a side x1, y1, x2, y2 that may go on for so much beyond its ends; none if it parts the sensors.
/** @param {Point} t @param {Point} l @param {Quad} side @param {number} beyond @returns {Way[]} */
export function overSide(t, l, [x1, y1, x2, y2], beyond) {
  const length = Math.hypot(x2 - x1, y2 - y1);
  if (length === 0) return [];
  const ux = (x2 - x1) / length,
    uy = (y2 - y1) / length;
  const [from, to] = [t, l].map(({ x, y }) => ({
    along: (x - x1) * ux + (y - y1) * uy,
    away: (y - y1) * ux - (x - x1) * uy,
  }));
  if (from.away * to.away <= 0) return [];
  const at = (from.along * to.away + to.along * from.away) / (from.away + to.away);
  const along = Math.max(-beyond, Math.min(length + beyond, at));
  return [way(t, l, x1 + along * ux, y1 + along * uy)];
}

// The shortest way over a circle (Alhazen's problem), by Newton's method along its arc.
/** @param {Point} t @param {Point} l @param {Point} middle @param {number} radius @returns {Way} */
export function overCircle(t, l, { x, y }, radius) {
  if (radius === 0) return way(t, l, x, y);
  const away = [t, l].map((sensor) => Math.max(Math.hypot(sensor.x - x, sensor.y - y), radius));
  const weights = [(away[1] - radius) / away[0], (away[0] - radius) / away[1]];
  let turn = Math.atan2(
    weights[0] * (t.y - y) + weights[1] * (l.y - y),
    weights[0] * (t.x - x) + weights[1] * (l.x - x),
  );
  for (let step = 0; step < 4; step++) {
    const wx = Math.cos(turn),
      wy = Math.sin(turn);
    let slope = 0,
      bend = 0;
    for (const sensor of [t, l]) {
      const dx = sensor.x - x,
        dy = sensor.y - y;
      const far = Math.max(Math.hypot(dx - radius * wx, dy - radius * wy), 1e-6);
      const across = (radius * (dx * wy - dy * wx)) / far;
      slope += across;
      bend += (radius * (dx * wx + dy * wy) - across ** 2) / far;
    }
    if (bend <= 0) break;
    turn -= slope / bend;
  }
  return way(t, l, x + radius * Math.cos(turn), y + radius * Math.sin(turn));
}
