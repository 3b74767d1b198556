// @ts-check
// The numbers of past frames by time, for the plots: each frame of the last minute, one a second of half an hour
// before.

const NEAR_S = 60;
const FAR_S = 1800;
const COARSE_S = 1;
const SLACK = 200; // old frames are thinned out once in so many

// What the places of a short list hold.
/** @type {Record<string, string[]>} */
const PLACES = {
  pose: ["x", "y", "heading"],
  frame: ["x", "y", "heading"],
  twist: ["v", "w"],
  covariance: ["xx", "xy", "yy", "heading"],
};
// Positions in a list say nothing from one frame to the next; these are drawn on the map.
const LEFT_OUT = new Set([
  "firing",
  "clusters",
  "areas",
  "sensors",
  "segments",
  "archived",
  "polylines",
  "known_way",
  "steps",
  "way",
  "number",
  "hidden_by",
  "robot_s",
  "host_s",
]);

// Yields the parts of a field by name: objects by their number, vectors by their schema, numbers by what they hold.
/** @param {object} value @param {string} name @returns {Generator<[string, unknown]>} */
function* parts(value, name) {
  if (!Array.isArray(value)) {
    yield* Object.entries(value);
    return;
  }
  for (const [i, item] of value.entries()) {
    if (typeof item === "number" || item === null) yield [PLACES[name]?.[i] ?? String(i), item];
    else if (typeof item?.number === "number") yield [String(item.number), item];
    else if (typeof item?.[0] === "string") yield [item[0], { x: item[1], y: item[2] }];
  }
}

// Yields the path of every number of a frame: "pose.x", "ranges.3", "objects.7.probability".
/** @param {object} value @returns {Generator<string>} */
export function* numericFields(value, path = "", name = "") {
  for (const [key, part] of parts(value, name)) {
    if (LEFT_OUT.has(key)) continue;
    const at = path === "" ? key : `${path}.${key}`;
    if (typeof part === "number" || typeof part === "boolean") yield at;
    else if (typeof part === "object" && part !== null) yield* numericFields(part, at, key);
  }
}

// The number at such a path; null where the frame has none.
/** @param {object} frame @param {string} path */
export function valueAt(frame, path) {
  let value = /** @type {unknown} */ (frame),
    name = "";
  for (const key of path.split(".")) {
    if (typeof value !== "object" || value === null) return null;
    const found = [...parts(value, name)].find(([one]) => one === key);
    [value, name] = [found?.[1], key];
  }
  return typeof value === "number" || typeof value === "boolean" ? Number(value) : null;
}

/** @typedef {{ t: number; frame: object; values: Record<string, number | null> }} Sample */

export class History {
  /** @type {Sample[]} */
  samples = []; // by time

  clear() {
    this.samples = [];
  }

  // Frames of a recording come in any order; one of the same time replaces the older.
  /** @param {number} t @param {object} frame */
  add(t, frame) {
    const { samples } = this;
    let at = samples.length;
    while (at > 0 && samples[at - 1].t >= t) at--;
    samples.splice(at, samples[at]?.t === t ? 1 : 0, { t, frame, values: {} });
    if (samples.length % SLACK === 0) this.#thin(t);
  }

  /** @param {number} now */
  #thin(now) {
    let last = -Infinity;
    this.samples = this.samples.filter(({ t }) => {
      if (Math.abs(now - t) > FAR_S) return false;
      if (Math.abs(now - t) < NEAR_S) return true;
      if (t - last < COARSE_S) return false;
      last = t;
      return true;
    });
  }

  // The points [t, value] of a field between two times; null where a frame does not have it.
  /** @param {string} path @param {number} from @param {number} to */
  series(path, from, to) {
    /** @type {Array<[number, number | null]>} */
    const points = [];
    for (const { t, frame, values } of this.samples) {
      if (t < from || t > to) continue;
      if (!(path in values)) values[path] = valueAt(frame, path);
      points.push([t, values[path]]);
    }
    return points;
  }
}
