// @ts-check
// Feet or metres: the wire is SI; everything displayed is in the chosen unit.

import { Emitter } from "./emitter.js";

const METRES_A_FOOT = 0.3048;
// A standard error has at most so many decimals: a tenth of a millimetre.
const SPREAD_DIGITS = 4;

/** @extends {Emitter<{ changed: [] }>} */
export class Units extends Emitter {
  name = "m";

  /** @param {string} name */
  choose(name) {
    this.name = name === "ft" ? "ft" : "m";
    this.emit("changed");
  }

  get metres() {
    return this.name === "ft" ? METRES_A_FOOT : 1;
  }

  get word() {
    return this.name === "ft" ? "feet" : "metres";
  }

  /** @param {number} metres */
  number(metres, digits = 2) {
    return (metres / this.metres).toFixed(digits).replace("-", "−");
  }

  /** @param {number} metres */
  length(metres, digits = 2) {
    return `${this.number(metres, digits)} ${this.name}`;
  }

  // A standard error in the unit of the page, with two digits that count, or the last of SPREAD_DIGITS.
  /** @param {number} sigma */
  spread(sigma) {
    if (!(sigma < 10000)) return "± more than 10 km";
    const shown = sigma / this.metres;
    const least = 10 ** -SPREAD_DIGITS;
    if (!(shown >= 0.5 * least)) return `± less than ${least.toFixed(SPREAD_DIGITS)} ${this.name}`;
    let digits = 0;
    while (digits < SPREAD_DIGITS && shown < 9.95 * 0.1 ** digits) digits += 1;
    return `± ${this.length(sigma, digits)}`;
  }

  /** @param {number} x @param {number} y */
  place(x, y, digits = 2) {
    return `${this.number(x, digits)}, ${this.number(y, digits)} ${this.name}`;
  }

  // The length in a field, m; null where that is none. A field that still shows `was` has not rounded it.
  /** @param {string} text @param {number | null} [was] */
  parse(text, was = null) {
    if (was !== null && text.trim() === this.number(was)) return was;
    const value = numberIn(text);
    return value === null || !Number.isFinite(value) ? null : value * this.metres;
  }
}

// The number in a field: null where nothing is written, NaN where that is no number.
/** @param {string} text */
export function numberIn(text) {
  const written = text.trim();
  return written === "" ? null : Number(written.replace("−", "-").replace(",", "."));
}

// "1 run", "2 runs"
/** @param {number} count @param {string} noun */
export const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;

/** @template {number | null} T @param {T} degrees */
export const radians = (degrees) => /** @type {T} */ (degrees === null ? null : (degrees * Math.PI) / 180);

// From −180° to 180°, however often the robot has turned; with its standard error if that is known.
/** @param {number} radians @param {number | null} [sigma] */
export const degrees = (radians, sigma = null) =>
  `${Math.round((Math.atan2(Math.sin(radians), Math.cos(radians)) * 180) / Math.PI)}°`.replace("-", "−") +
  (sigma === null ? "" : ` ${turnSpread(sigma)}`);

// An angle's standard error; no evidence makes it nought.
/** @param {number} sigma */
export function turnSpread(sigma) {
  const deg = (180 * sigma) / Math.PI;
  return deg >= 0.05 ? `± ${deg.toFixed(1)}°` : "± less than 0.1°";
}

// A probability; no evidence makes it 0 or 100.
/** @param {number} share */
export const percent = (share) => `${share >= 0.995 ? "> 99" : share < 0.005 ? "< 1" : Math.round(100 * share)} %`;

// A natural logarithm of odds as the number of times: 1.2, 11, 10⁵. Readings are not so independent that a greater
// number could be meant.
/** @param {number} logarithm */
export function times(logarithm) {
  const tens = logarithm / Math.LN10;
  if (tens < 4) return String(Number(Math.exp(logarithm).toPrecision(2)));
  return tens < 6 ? `10${tens < 4.5 ? "⁴" : tens < 5.5 ? "⁵" : "⁶"}` : "more than a million";
}

// The magnitude of a schema's vector; inside the safety margin it is a million, for Arkin's infinity.
/** @param {number} size */
export const magnitude = (size) => (size < 1000 ? size.toFixed(2) : "unbounded");
