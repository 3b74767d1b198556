// The route that the operator sets: its waypoints in one frame, a history for undo, and what of it the robot drives.
// While the robot drives the route, each change is sent at once; what lies behind the robot cannot be changed.

import { Emitter } from "./emitter.js";
import { inPlane } from "./map_frame.js";

const HISTORY = 50;
const WAYPOINTS_MAX = 64; // config.mission_step.STEPS_MAX
const degrees = (rad) => Math.round((rad * 180) / Math.PI) % 360;
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

export class Route extends Emitter {
  waypoints = []; // [x, y, final heading in degrees or null]
  frame = "odom";
  selected = null; // index
  #history = [];
  #sent = null; // waypoints that the robot does not show yet

  constructor({ run, connection, notifications }) {
    super();
    Object.assign(this, { run, connection, notifications });
    run.on("state", () => this.#follow());
    connection.on("closed", () => {
      this.#sent = null;
    });
  }

  // The robot's mission if that is a route; null otherwise.
  get #shown() {
    const { drive_request: mission } = this.run.state;
    return mission?.kind === "mission" && mission.name === "route" ? mission : null;
  }

  // The same, if it goes on.
  get #driven() {
    return ["running", "held"].includes(this.#shown?.status) ? this.#shown : null;
  }

  get isDriven() {
    return this.#sent !== null || this.#driven !== null;
  }

  // How many waypoints lie behind the robot.
  get behind() {
    return this.#driven?.step ?? 0;
  }

  get canUndo() {
    return this.#history.length > 0;
  }

  // A waypoint in the plane: [x, y, heading in radians or null]; null where the map frame is not known.
  inPlane([x, y, turn]) {
    return inPlane(this.run.state.localized, this.frame, x, y, turn === null ? null : (turn * Math.PI) / 180);
  }

  // Adds a waypoint of the plane at the end; heading in radians, null for any.
  add(x, y, heading) {
    if (this.waypoints.length === 0) this.frame = this.run.state.localized?.status === "tracking" ? "map" : "odom";
    if (this.waypoints.length >= WAYPOINTS_MAX)
      return this.notifications.toast(`A route has at most ${WAYPOINTS_MAX} waypoints`);
    const there = this.#ofPlane(x, y, heading);
    return there && this.#change([...this.waypoints, there], this.waypoints.length);
  }

  move(i, x, y, heading = this.inPlane(this.waypoints[i])?.[2] ?? null) {
    const there = this.#ofPlane(x, y, heading);
    return there && this.set(i, heading === null ? there : [there[0], there[1], this.waypoints[i][2] ?? there[2]]);
  }

  // Gives a waypoint its final heading in the plane, radians; null for any.
  turn(i, heading) {
    const [x, y] = this.waypoints[i],
      frame = this.frame === "map" ? (this.run.state.localized?.frame[2] ?? 0) : 0;
    return this.set(i, [x, y, heading === null ? null : degrees(heading - frame)]);
  }

  set(i, waypoint) {
    return this.#change(
      this.waypoints.map((one, k) => (k === i ? waypoint : one)),
      i,
    );
  }

  remove(i) {
    const rest = this.waypoints.filter((_, k) => k !== i);
    return this.#change(rest, rest.length === 0 ? null : Math.min(i, rest.length - 1));
  }

  // Moves a waypoint earlier (-1) or later (1).
  reorder(i, by) {
    const to = i + by;
    if (to < this.behind || to >= this.waypoints.length || i < this.behind) return undefined;
    const order = [...this.waypoints];
    [order[i], order[to]] = [order[to], order[i]];
    return this.#change(order, to);
  }

  clear() {
    return this.#change(this.waypoints.slice(0, this.behind), null);
  }

  load(waypoints, frame) {
    return this.#change(
      waypoints.map((one) => [...one]),
      null,
      frame,
    );
  }

  undo() {
    const before = this.#history.pop();
    if (before === undefined) return this.notifications.toast("There is no change of the route to undo");
    [this.waypoints, this.frame] = [before.waypoints, before.frame];
    return this.#changed(null);
  }

  select(i) {
    this.selected = i;
    this.emit("changed");
  }

  // Begins to drive the route, from its first waypoint unless it goes on from one that was done.
  drive() {
    if (this.waypoints.length > 0) return this.#send();
    return this.notifications.toast("There is no waypoint yet: choose the tool and click on the map");
  }

  #ofPlane(x, y, heading) {
    const { localized } = this.run.state;
    if (this.frame === "odom") return [x, y, heading === null ? null : degrees(heading)];
    if (!localized) {
      this.notifications.toast(
        "The robot does not know its place in the map, and the route's waypoints are places there",
      );
      return null;
    }
    const [x0, y0, turn] = localized.frame,
      c = Math.cos(turn),
      s = Math.sin(turn);
    return [
      c * (x - x0) + s * (y - y0),
      c * (y - y0) - s * (x - x0),
      heading === null ? null : degrees(heading - turn),
    ];
  }

  #change(waypoints, selected, frame = this.frame) {
    if (this.isDriven && !same(waypoints.slice(0, this.behind), this.waypoints.slice(0, this.behind))) {
      return this.notifications.toast(
        "The robot is past this waypoint: change the ones ahead of it, or HALT and drive another route",
      );
    }
    this.#history = [...this.#history, { waypoints: this.waypoints, frame: this.frame }].slice(-HISTORY);
    [this.waypoints, this.frame] = [waypoints, frame];
    return this.#changed(selected);
  }

  #changed(selected) {
    this.selected = selected;
    this.emit("changed");
    return this.isDriven ? this.#send() : undefined;
  }

  async #send() {
    const { waypoints, frame } = this;
    this.#sent = waypoints;
    try {
      if (waypoints.length === 0) await this.connection.request({ type: "skip_step" });
      else await this.connection.request({ type: "set_route", waypoints, frame });
    } catch (error) {
      if (this.#sent === waypoints) this.#sent = null;
      this.notifications.showError(error);
    }
  }

  // Takes over the route that the robot drives, unless a change of it is on its way.
  #follow() {
    const mission = this.#shown;
    const driven = mission?.steps.map(({ places }) => places[0]) ?? null;
    if (this.#sent !== null) {
      if (this.#sent.length > 0 && !same(driven, this.#sent)) return;
      this.#sent = null;
      this.emit("changed");
    }
    if (this.#driven === null || same(driven, this.waypoints)) return;
    if (this.waypoints.length > 0) this.#history.push({ waypoints: this.waypoints, frame: this.frame });
    [this.waypoints, this.frame, this.selected] = [driven, mission.steps[0].frame, null];
    this.emit("changed");
  }
}
