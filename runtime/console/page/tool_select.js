// @ts-check
// Pan and select: a click selects the object or segment under it, a drag lassoes segments; Shift adds to the selection.

import { byId, setText } from "./dom.js";
import { nearestSegment } from "./draw_segments.js";
import { drawLasso } from "./tool_overlays.js";
import { counted } from "./units.js";
import { distanceToLine, isWall } from "./walls.js";

const CLICK_PX = 4;
const REACH_PX = 12;
const TOUCH_PX = 22;

/** @param {View} view @returns {Tool} */
export const panTool = (view) => ({
  id: "pan",
  name: "Move the map",
  icon: "i-pan",
  move: (at, was) => view.pan(at.sx - was.sx, at.sy - was.sy),
});

// The object under a point: inside its outline's circle, or near its middle.
/** @param {RunState} run @param {View} view @param {Spot} at */
export function objectAt(run, view, { x, y, touch }) {
  let best = /** @type {ShownObject | null} */ (null),
    nearest = Infinity;
  for (const object of run.state.objects) {
    if (object.number === null) continue;
    const radius = run.model(object.model)?.arc_radius_m ?? 0;
    const away = isWall(object) ? distanceToLine(object.ends, x, y) : Math.hypot(object.x - x, object.y - y);
    if (away < Math.max(radius, (touch ? TOUCH_PX : REACH_PX) / view.scale) && away < nearest)
      [best, nearest] = [object, away];
  }
  return best;
}

/** @param {Pick<Parts, "run" | "view" | "selection" | "redraw">} parts @returns {Tool} */
export function selectTool({ run, view, selection, redraw }) {
  const tip = byId("tip");
  const hideTip = () => {
    tip.hidden = true;
  };
  let lasso = /** @type {Spot[]} */ ([]);

  /** @param {Spot} at */
  const click = (at) => {
    const reach = (at.touch ? TOUCH_PX : REACH_PX) / view.scale;
    const segment = nearestSegment(run, at.x, at.y, reach);
    if (segment !== null) {
      if (at.shift) selection.toggle(segment.number);
      else selection.choose([segment.number]);
      const behind = objectAt(run, view, at); // a wall lies under its segments
      if (behind !== null && isWall(behind)) selection.pick(behind.number);
      return;
    }
    const object = objectAt(run, view, at);
    if (object !== null) selection.pick(object.number);
    else if (!at.shift) {
      selection.choose([]);
      selection.pick(null);
    }
  };
  const stop = () => {
    lasso = [];
    redraw();
  };
  return {
    id: "select",
    name: "Select segments and objects",
    icon: "i-select",
    // Shows a segment's number and age beside the pointer.
    hover(at) {
      const segment = nearestSegment(run, at.x, at.y, REACH_PX / view.scale);
      tip.hidden = segment === null;
      if (segment === null) return;
      const age =
        segment.t === null ? "of unknown age" : `${Math.max(0, run.state.robot_s - segment.t).toFixed(1)} s old`;
      setText(tip, `segment ${segment.number}, ${age}${segment.pinned ? ", pinned" : ""}`);
      const left = at.sx + 220 > view.width ? at.sx - 190 : at.sx + 14;
      tip.style.transform = `translate(${left}px, ${Math.max(4, at.sy - 34)}px)`;
    },
    leave: hideTip,
    end: hideTip,
    down(at) {
      hideTip();
      lasso = [at];
    },
    move(at) {
      if (lasso.length === 0) return;
      lasso.push(at);
      redraw();
    },
    up(at) {
      if (lasso.length === 0) return;
      const [began] = lasso;
      const moved = lasso.some(({ sx, sy }) => Math.hypot(sx - began.sx, sy - began.sy) > CLICK_PX);
      if (!moved) click(at);
      else {
        const inside = within(run, lasso);
        if (began.shift) selection.add(inside);
        else selection.choose(inside);
      }
      stop();
    },
    press: (at) => click({ ...at, shift: true }),
    key(event) {
      if (event.key.toLowerCase() !== "a" || event.shiftKey) return false;
      const [left, top] = view.toWorld(0, 0),
        [right, bottom] = view.toWorld(view.width, view.height);
      selection.choose(
        within(run, [
          { x: left, y: top },
          { x: right, y: top },
          { x: right, y: bottom },
          { x: left, y: bottom },
        ]),
      );
      return true;
    },
    none() {
      selection.choose([]);
      selection.pick(null);
    },
    cancel: stop,
    draw: (f) => drawLasso(f, lasso),
  };
}

// The segments whose middle lies within a polygon.
/** @param {RunState} run @param {Point[]} polygon */
function within(run, polygon) {
  /** @type {number[]} */
  const found = [];
  for (const s of run.segments.values()) {
    const x = (s.x1 + s.x2) / 2,
      y = (s.y1 + s.y2) / 2;
    let inside = false;
    for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i++) {
      const a = polygon[i],
        b = polygon[j];
      if (a.y > y !== b.y > y && x < ((b.x - a.x) * (y - a.y)) / (b.y - a.y) + a.x) inside = !inside;
    }
    if (inside) found.push(s.number);
  }
  return found;
}

// The row of buttons for the selected segments.
/** @param {Pick<Parts, "run" | "selection" | "connection" | "notifications">} parts */
export function selectionBar({ run, selection, connection, notifications }) {
  const refresh = () => {
    const count = selection.segments.size;
    byId("selection-bar").hidden = count === 0;
    setText(byId("selection-count"), counted(count, "segment"));
  };
  /** @param {boolean} pinned */
  const pin = (pinned) => {
    const numbers = [...selection.segments];
    if (numbers.length > 0)
      connection.request({ type: "pin_segments", numbers, pinned }).catch(notifications.showError);
  };
  const actions = {
    delete: () => {
      const numbers = [...selection.segments],
        count = numbers.length;
      if (count === 0) return;
      connection.request({ type: "delete_segments", numbers }).then(() => {
        selection.choose([]);
        notifications.toast(`${count} segment${count === 1 ? " is" : "s are"} deleted; Ctrl+Z undoes it`);
      }, notifications.showError);
    },
    pin: () => pin(true),
    unpin: () => pin(false),
    none: () => selection.choose([]),
  };
  for (const [name, action] of Object.entries(actions)) byId(`selection-${name}`).addEventListener("click", action);
  selection.on("segments", refresh);
  run.on("state", refresh);
  return actions;
}
