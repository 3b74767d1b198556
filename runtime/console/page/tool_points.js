// @ts-check
// Tools that take points: the goal to drive to, and the measuring tape.

import { drawTape, describeTape } from "./tool_overlays.js";
import { pressedHeading } from "./tool_route.js";

// A click gives the place, a drag from it the final heading there.
/**
 * @typedef {(x: number, y: number, heading: number | null) => void} SendGoal
 * @param {Pick<Parts, "redraw"> & { sendGoal: SendGoal; after: () => void }} parts @returns {Tool}
 */
export function goalTool({ sendGoal, after, redraw }) {
  let from = /** @type {Spot | null} */ (null),
    to = /** @type {Spot | null} */ (null);
  const stop = () => {
    from = to = null;
    redraw();
  };
  return {
    id: "goal",
    sends: true,
    name: "Drive to a goal; drag for the final heading",
    icon: "i-goal",
    down(at) {
      from = to = at;
    },
    move(at) {
      to = at;
      redraw();
    },
    up(at) {
      if (!from) return;
      sendGoal(from.x, from.y, pressedHeading(from, at));
      stop();
      after();
    },
    cancel: stop,
    draw: (f) => {
      if (from !== null && to !== null && pressedHeading(from, to) !== null) drawTape(f, from, to);
    },
  };
}

/** @param {Pick<Parts, "units" | "redraw"> & { announce: (text: string) => void }} parts @returns {Tool} */
export function tapeTool({ units, announce, redraw }) {
  let from = /** @type {Spot | null} */ (null),
    to = /** @type {Spot | null} */ (null),
    pulling = false;

  return {
    id: "tape",
    name: "Measuring tape",
    icon: "i-tape",
    down(at) {
      if (from !== null && pulling) return; // the second of two clicks
      from = to = at;
      pulling = true;
    },
    move(at) {
      if (pulling) to = at;
      redraw();
    },
    hover(at) {
      if (pulling) to = at;
      redraw();
    },
    up(at) {
      if (!pulling) return;
      to = at;
      if (from !== null && Math.hypot(to.sx - from.sx, to.sy - from.sy) > 4) {
        pulling = false;
        announce(`Tape: ${describeTape(units, from, to)}`);
      }
      redraw();
    },
    cancel() {
      pulling = false;
    },
    none() {
      from = to = null;
    },
    drawAlways: (f) => {
      if (from && to && from !== to) drawTape(f, from, to);
    },
  };
}
