// Tools that take points: the goal to drive to, the waypoints of a route, and the measuring tape.

import { drawTape, describeTape } from "./tool_overlays.js";

export function goalTool({ sendGoal, after }) {
  return {
    id: "goal", sends: true, name: "Drive to a goal", icon: "i-goal",
    up(at) {
      sendGoal(at.x, at.y);
      after();
    },
  };
}

// A click adds a waypoint; a drag from it gives the final heading there.
export function routeTool({ addWaypoint, redraw }) {
  let from = null, to = null;
  const heading = () => (from && to && Math.hypot(to.sx - from.sx, to.sy - from.sy) > 12 ? Math.atan2(to.y - from.y, to.x - from.x) : null);
  return {
    id: "route", sends: true, name: "Add waypoints to a route; drag for the final heading", icon: "i-route",
    down(at) {
      from = to = at;
    },
    move(at) {
      to = at;
      redraw();
    },
    up(at) {
      if (!from) return;
      to = at;
      addWaypoint(from.x, from.y, heading());
      from = to = null;
    },
    cancel() {
      from = to = null;
    },
    draw: (f) => heading() !== null && drawTape(f, from, to),
  };
}

export function tapeTool({ units, announce, redraw }) {
  let from = null, to = null, pulling = false;

  const tell = () => announce(`Tape: ${describeTape(units, from, to)}`);
  return {
    id: "tape", name: "Measuring tape", icon: "i-tape",
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
      if (Math.hypot(to.sx - from.sx, to.sy - from.sy) > 4) {
        pulling = false;
        tell();
      }
      redraw();
    },
    cancel() {
      pulling = false;
    },
    none() {
      from = to = null;
    },
    drawAlways: (f) => from && to && from !== to && drawTape(f, from, to),
  };
}
