// @ts-check
// The time axis that all plots share: it follows the newest frame until it is zoomed or moved, by wheel, pointer or
// buttons.

import { PRESS_ENDS } from "./dom.js";

const LEAST_S = 0.5;
const MOST_S = 1800;
const WHEEL = 0.0016;
const STEPS_S = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 60, 120, 300, 600];
const TICKS_MAX = 7;

export class PlotTime {
  /** @type {{ from: number; to: number } | null} */
  #held = null; // where it does not follow

  /** @param {() => void} changed */
  constructor(changed) {
    this.changed = changed;
  }

  get isHeld() {
    return this.#held !== null;
  }

  // The time shown: up to the newest frame, in a recording around the present moment.
  /** @param {{ long: number; now: number; newest: number }} frame @returns {Span} */
  span({ long, now, newest }) {
    if (this.#held !== null) return { ...this.#held, now };
    const to = Math.min(newest, now + long / 2);
    return { from: to - long, to, now };
  }

  follow() {
    this.#held = null;
    this.changed();
  }

  // Makes the span `factor` times as long about a moment.
  /** @param {{ from: number; to: number }} span @param {number} factor */
  zoom({ from, to }, factor, about = to) {
    const long = Math.max(LEAST_S, Math.min((to - from) * factor, MOST_S));
    const share = (about - from) / (to - from);
    this.#held = { from: about - share * long, to: about + (1 - share) * long };
    this.changed();
  }

  /** @param {{ from: number; to: number }} span @param {number} by_s */
  pan({ from, to }, by_s) {
    this.#held = { from: from + by_s, to: to + by_s };
    this.changed();
  }

  // Zooms by wheel and moves by drag; `span` returns what is shown, `left` is where the axis begins, px. A press
  // without a drag is left to others.
  /** @param {HTMLCanvasElement} canvas @param {() => Span} span @param {number} left */
  watch(canvas, span, left) {
    const perPixel = () => (({ from, to }) => (to - from) / Math.max(1, canvas.clientWidth - left))(span());
    let held = /** @type {{ x: number } | null} */ (null);
    canvas.addEventListener(
      "wheel",
      (event) => {
        if (!event.deltaY) return;
        event.preventDefault();
        this.zoom(span(), Math.exp(event.deltaY * WHEEL), span().from + (event.offsetX - left) * perPixel());
      },
      { passive: false },
    );
    canvas.addEventListener("pointerdown", (event) => {
      held = { x: event.clientX };
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (held === null || event.clientX === held.x) return;
      this.pan(span(), (held.x - event.clientX) * perPixel());
      held.x = event.clientX;
    });
    for (const name of PRESS_ENDS)
      canvas.addEventListener(name, () => {
        held = null;
      });
    canvas.addEventListener("dblclick", () => this.follow());
  }
}

// The moments to mark between two times, at most a few, at whole steps before or after `now`.
/** @param {Span} span */
export function ticks({ from, to, now }) {
  const step = STEPS_S.find((one) => (to - from) / one <= TICKS_MAX) ?? STEPS_S[STEPS_S.length - 1];
  /** @type {Array<[number, string]>} */
  const marks = [];
  for (let k = Math.ceil((from - now) / step); now + k * step <= to + 1e-9; k++) {
    const s = k * step;
    marks.push([now + s, s === 0 ? "now" : `${s > 0 ? "+" : "−"}${Number(Math.abs(s).toFixed(1))} s`]);
  }
  return marks;
}
