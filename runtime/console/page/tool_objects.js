// Objects by hand: move one and turn it, put a model where one should stand. The model then relaxes from there.

import { byId, el } from "./dom.js";
import { drawGhost } from "./tool_marks.js";
import { objectAt } from "./tool_select.js";

const HANDLE_PX = 20;
const ARM_PX = 30;
const NUDGE_M = 0.01;
const TURN = Math.PI / 36;
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

const radiusOf = (model) => {
  if (!model) return 0.1;
  return model.arc_radius_m ?? Math.max(...model.vertices.map(([x, y]) => Math.hypot(x, y)));
};

function handleOf(view, model, { x, y, theta }) {
  const reach = radiusOf(model) + ARM_PX / view.scale;
  return { x: x + reach * Math.cos(theta), y: y + reach * Math.sin(theta) };
}

export function moveTool({ world, view, selection, connection, notices, redraw }) {
  let held = null; // {pose, dx, dy, turning}

  const send = (number, { x, y, theta }) => connection.ask({ type: "move_object", object: number, x, y, theta }).catch(notices.refused);
  const picked = () => (selection.object === null ? null : world.object(selection.object));
  const poseOf = ({ x, y, theta }) => ({ x, y, theta });
  const drop = () => {
    held = null;
    redraw();
  };
  return {
    id: "move", name: "Move and turn an object", icon: "i-move",
    down(at) {
      const object = picked();
      if (object !== null) {
        const handle = handleOf(view, world.model(object.model), object);
        if (Math.hypot(handle.x - at.x, handle.y - at.y) < HANDLE_PX / view.scale) {
          held = { pose: poseOf(object), turning: true, model: object.model };
          return;
        }
      }
      const hit = objectAt(world, view, at);
      selection.pick(hit?.number ?? null);
      held = hit === null ? null : { pose: poseOf(hit), dx: hit.x - at.x, dy: hit.y - at.y, turning: false, model: hit.model, began: at };
      redraw();
    },
    move(at) {
      if (held === null) return;
      if (held.turning) held.pose.theta = Math.atan2(at.y - held.pose.y, at.x - held.pose.x);
      else Object.assign(held.pose, { x: at.x + held.dx, y: at.y + held.dy });
      held.moved = true;
      redraw();
    },
    up() {
      if (held?.moved) send(selection.object, held.pose);
      drop();
    },
    cancel: drop,
    none: () => selection.pick(null),
    // Arrows nudge the picked object by a centimetre (with Shift ten), brackets turn it by 5°.
    key(event, spot) {
      const object = picked();
      if (event.key === "Enter") {
        selection.pick(objectAt(world, view, spot())?.number ?? null);
        return true;
      }
      if (object === null) return false;
      const by = ARROWS[event.key], turn = { "[": TURN, "]": -TURN }[event.key];
      if (!by && !turn) return false;
      const step = NUDGE_M * (event.shiftKey ? 10 : 1);
      const pose = poseOf(object);
      if (by) send(object.number, { ...pose, x: pose.x + by[0] * step, y: pose.y + by[1] * step });
      else send(object.number, { ...pose, theta: pose.theta + turn });
      return true;
    },
    draw(f) {
      const object = picked();
      if (held) drawGhost(f, world.model(held.model), held.pose, handleOf(view, world.model(held.model), held.pose));
      else if (object) drawGhost(f, world.model(object.model), object, handleOf(view, world.model(object.model), object));
    },
  };
}

export function placeTool({ world, view, connection, notices, redraw }) {
  const chooser = byId("placing-model");
  let pose = null;
  let last = 0; // the heading of the one before, for a row of like things

  world.on("session", ({ models }) => {
    const chosen = chooser.value;
    chooser.replaceChildren(...models.map(({ name }) => el("option", { value: name }, name)));
    if (models.some(({ name }) => name === chosen)) chooser.value = chosen;
  });
  const put = ({ x, y, theta }) => connection.ask({ type: "place_model", model: chooser.value, x, y, theta })
    .then(() => notices.toast(`${chooser.value} placed; it relaxes from there`), notices.refused);
  const forget = () => {
    pose = null;
    redraw();
  };
  return {
    id: "place", name: "Place a model", icon: "i-place",
    begin: () => {
      byId("placing").hidden = false;
    },
    end: () => {
      byId("placing").hidden = true;
      pose = null;
    },
    hover(at) {
      pose = { x: at.x, y: at.y, theta: last };
      redraw();
    },
    leave: forget,
    down(at) {
      pose = { x: at.x, y: at.y, theta: last, pressed: true };
      redraw();
    },
    move(at) {
      if (!pose?.pressed) return;
      if (Math.hypot(at.x - pose.x, at.y - pose.y) * view.scale > 10) pose.theta = Math.atan2(at.y - pose.y, at.x - pose.x);
      redraw();
    },
    up() {
      if (pose?.pressed) {
        last = pose.theta;
        put(pose);
      }
      forget();
    },
    key(event) {
      const turn = { "[": TURN, "]": -TURN }[event.key];
      if (!turn) return false;
      last += turn;
      if (pose) pose.theta = last;
      return true;
    },
    cancel: forget,
    draw(f) {
      const model = world.model(chooser.value);
      if (pose && model) drawGhost(f, model, pose, pose.pressed ? handleOf(view, model, pose) : null);
    },
  };
}
