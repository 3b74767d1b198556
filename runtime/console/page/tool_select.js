// Pan and select: a click selects the object or segment under it, a drag lassoes segments; Shift adds to the selection.

import { byId, setText } from "./dom.js";
import { nearestSegment } from "./draw_segments.js";
import { drawLasso } from "./tool_overlays.js";
import { distanceToLine, isWall } from "./walls.js";

const CLICK_PX = 4;
const REACH_PX = 12;
const TOUCH_PX = 22;

export const panTool = (view) => ({
  id: "pan",
  name: "Move the map",
  icon: "i-pan",
  move: (at, was) => view.pan(at.sx - was.sx, at.sy - was.sy),
});

// The object under a point: inside its outline's circle, or near its middle.
export function objectAt(run, view, { x, y, touch }) {
  let best = null,
    nearest = Infinity;
  for (const object of run.state.objects) {
    if (object.number === null || object.number === undefined) continue;
    const radius = run.model(object.model)?.arc_radius_m ?? 0;
    const away = isWall(object) ? distanceToLine(object.ends, x, y) : Math.hypot(object.x - x, object.y - y);
    if (away < Math.max(radius, (touch ? TOUCH_PX : REACH_PX) / view.scale) && away < nearest)
      [best, nearest] = [object, away];
  }
  return best;
}

export function selectTool({ run, view, selection, redraw }) {
  const tip = byId("tip");
  const hideTip = () => {
    tip.hidden = true;
  };
  let lasso = null;
  let began = null;

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
    lasso = began = null;
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
      const age = Number.isFinite(segment.t)
        ? `${Math.max(0, run.state.robot_s - segment.t).toFixed(1)} s old`
        : "of unknown age";
      setText(tip, `segment ${segment.number}, ${age}${segment.pinned ? ", pinned" : ""}`);
      const left = at.sx + 220 > view.width ? at.sx - 190 : at.sx + 14;
      tip.style.transform = `translate(${left}px, ${Math.max(4, at.sy - 34)}px)`;
    },
    leave: hideTip,
    end: hideTip,
    down(at) {
      hideTip();
      began = at;
      lasso = [at];
    },
    move(at) {
      if (began === null) return;
      lasso.push(at);
      redraw();
    },
    up(at) {
      if (began === null) return;
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
    draw: (f) => lasso && drawLasso(f, lasso),
  };
}

// The segments whose middle lies within a polygon.
function within(run, polygon) {
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
export function selectionBar({ run, selection, connection, notifications }) {
  const numbers = () => [...selection.segments];
  const refresh = () => {
    const count = selection.segments.size;
    byId("selection-bar").hidden = count === 0;
    setText(byId("selection-count"), `${count} segment${count === 1 ? "" : "s"}`);
  };
  const act = (message, done) => {
    if (selection.segments.size === 0) return;
    connection.request({ ...message, numbers: numbers() }).then(done, notifications.showError);
  };
  const actions = {
    delete: () => {
      const count = selection.segments.size;
      act({ type: "delete_segments" }, () => {
        selection.choose([]);
        notifications.toast(`${count} segment${count === 1 ? " is" : "s are"} deleted; Ctrl+Z undoes it`);
      });
    },
    pin: () => act({ type: "pin_segments", pinned: true }),
    unpin: () => act({ type: "pin_segments", pinned: false }),
    none: () => selection.choose([]),
  };
  for (const [name, action] of Object.entries(actions)) byId(`selection-${name}`).addEventListener("click", action);
  selection.on("segments", refresh);
  run.on("state", refresh);
  return actions;
}
