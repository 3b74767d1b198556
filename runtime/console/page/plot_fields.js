// @ts-check
// The fields of plots: their names, units, and the values derived from them, as the rate of one or the difference of
// two.

/** @typedef {import("./history.js").History} History */

const DEGREES = 180 / Math.PI;
const GAP_S = 2.5; // no rate over a gap
// How a field is shown: the first rule whose pattern matches says unit and factor; lengths follow the page's units.
/** @type {Array<[RegExp, string, number]>} */
const RULES = [
  [
    /^(pose|localized\.(pose|frame)|objects\.\d+)\.[xy]$|^drive_request\.[xyv]$|^ranges\.|\.sigma$|way_m$|^twist\.v$/,
    "length",
    1,
  ],
  [/heading$|theta$|^twist\.w$|^drive_request\.w$|^ring_yaw$|direction$/, "°", DEGREES],
  [/^phases\.|_us$/, "ms", 1e-3],
  [/^age\.|_s$|\.s$/, "s", 1],
  [/bytes$/, "MB", 1e-6],
];
const PER_SECOND = new Set(["twist.v", "twist.w", "drive_request.v", "drive_request.w"]);
/** @type {Array<[RegExp, string]>} */
const WORDS = [
  [/^twist\.v$/, "speed"],
  [/^twist\.w$/, "rate of turn"],
  [/^pose\.heading$/, "heading"],
  [/^ranges\./, "range "],
  [/^age\./, "age of range "],
  [/^phases\./, "phase "],
  [/^objects\./, "object "],
  [/^vectors\./, "vector "],
  [/_(us|s|m)$/, ""],
  [/[._]/g, " "],
];

// A derived field is written as "rate|pose.x" or "minus|ranges.0|ranges.1"; a field of the frame is its path.
/** @param {string} path */
export const rateOf = (path) => `rate|${path}`;
/** @param {string} path @param {string} other */
export const difference = (path, other) => `minus|${path}|${other}`;

/** @param {string} path */
const parts = (path) => path.split("|");
/** @param {string} path */
export const isDerived = (path) => path.includes("|");

/** @param {string} path @returns {string} */
export function fieldName(path) {
  const [kind, a, b] = parts(path);
  if (isDerived(path)) return kind === "rate" ? `rate of ${fieldName(a)}` : `${fieldName(a)} − ${fieldName(b)}`;
  return WORDS.reduce((name, [pattern, word]) => name.replace(pattern, word), path);
}

// Its unit, whether it is an angle that wraps, and what turns a value of the wire into that unit; `units` are the
// page's.
/**
 * @param {string} path @param {{ name: string; metres: number }} units
 * @returns {{ name: string; isAngle: boolean; factor: number }}
 */
export function shownAs(path, units) {
  if (isDerived(path)) {
    const [kind, of] = parts(path),
      { name, isAngle, factor } = shownAs(of, units);
    return {
      name: kind === "rate" ? `${name}/s`.replace("/s/s", "/s²") : name,
      isAngle: isAngle && kind !== "rate",
      factor,
    };
  }
  const [, unit = "", factor = 1] = RULES.find(([pattern]) => pattern.test(path)) ?? [];
  const name = (unit === "length" ? units.name : unit) + (PER_SECOND.has(path) ? "/s" : "");
  return {
    name,
    isAngle: unit === "°" && !PER_SECOND.has(path),
    factor: unit === "length" ? 1 / units.metres : factor,
  };
}

// No echo is −1 on the wire; here, as in a table, it is unknown.
/** @param {string} path @param {number | null} value */
const known = (path, value) => (value !== null && path.startsWith("ranges.") && value < 0 ? null : value);

// The points [t, value] of a field between two times, in units of the wire; null where it is not known.
/** @param {History} history @param {string} path @param {number} from @param {number} to @returns {TimedValue[]} */
export function seriesOf(history, path, from, to) {
  if (!isDerived(path)) return history.series(path, from, to).map(([t, value]) => [t, known(path, value)]);
  const [kind, a, b] = parts(path),
    first = seriesOf(history, a, from, to);
  /** @param {number} value */
  const turn = (value) =>
    shownAs(a, { name: "m", metres: 1 }).isAngle ? Math.atan2(Math.sin(value), Math.cos(value)) : value;
  if (kind === "rate") {
    return first.map(([t, value], i) => {
      const [before_s, before] = first[i - 1] ?? [t, null];
      return [
        t,
        value === null || before === null || t - before_s > GAP_S ? null : turn(value - before) / (t - before_s),
      ];
    });
  }
  const second = seriesOf(history, b, from, to);
  return first.map(([t, value], i) => {
    const other = second[i][1];
    return [t, value === null || other === null ? null : turn(value - other)];
  });
}
