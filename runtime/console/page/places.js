// Named places, no-go lines and areas, and speed areas: what the run has of them, and how the operator changes it.
// The process holds them and their undo, so that they outlive a reload of the page.

import { Emitter } from "./emitter.js";
import { inPlane } from "./map_frame.js";

export const KINDS = { place: "place", no_go_line: "no-go line", no_go_area: "no-go area", speed_area: "speed area" };
export const CORNERS_MIN = { place: 1, no_go_line: 2, no_go_area: 3, speed_area: 3 };
const SPEED_M_S = 0.15; // of a new speed area
const NONE = { frame: "odom", place: [], no_go_line: [], no_go_area: [], speed_area: [] };
const degrees = (rad) => Math.round((rad * 180) / Math.PI) % 360;
const millimetres = (value) => Math.round(value * 1000) / 1000;

export const cornersOf = (kind, row) =>
  kind === "place" ? [[row.x_m, row.y_m]] : kind === "no_go_line" ? row.points_m : row.vertices_m;
const withCorners = (kind, row, corners) =>
  kind === "place"
    ? { ...row, x_m: corners[0][0], y_m: corners[0][1] }
    : { ...row, [kind === "no_go_line" ? "points_m" : "vertices_m"]: corners };

export class Places extends Emitter {
  all = NONE;
  selected = null; // [kind, index]

  constructor({ run, connection, notifications }) {
    super();
    Object.assign(this, { run, connection, notifications });
    run.places = this;
    run.on("session", ({ places }) => this.#show(places ?? NONE));
    connection.on("places", (message) => this.#show(message));
  }

  get frameIsKnown() {
    return this.all.frame === "odom" || this.run.state.localized?.status === "tracking";
  }

  // A corner in the plane, [x, y, heading]; null while the map frame is not known.
  inPlane([x, y], heading = null) {
    return inPlane(this.run.state.localized, this.all.frame, x, y, heading);
  }

  // A place of the plane in the frame of the places; null where that is not known, which is said.
  ofPlane(x, y, heading = null) {
    const { localized } = this.run.state;
    if (this.all.frame === "odom") return [millimetres(x), millimetres(y), heading];
    if (localized?.status !== "tracking") {
      this.notifications.toast(
        "The robot does not know its place in the map, in which places lie: say where it is, or drive on",
      );
      return null;
    }
    const [x0, y0, turn] = localized.frame,
      c = Math.cos(turn),
      s = Math.sin(turn);
    return [
      millimetres(c * (x - x0) + s * (y - y0)),
      millimetres(c * (y - y0) - s * (x - x0)),
      heading === null ? null : heading - turn,
    ];
  }

  // Adds what was drawn: corners in the frame of the places; a heading in radians for a place.
  add(kind, corners, heading = null) {
    const row = withCorners(kind, {}, corners);
    if (kind === "place")
      Object.assign(row, { name: this.#freeName(), heading_deg: heading === null ? null : degrees(heading) });
    else row.name = "";
    if (kind === "speed_area") row.speed_max_m_s = SPEED_M_S;
    return this.#change(kind, [...this.all[kind], row], this.all[kind].length);
  }

  moveCorner(kind, i, corner, to) {
    const corners = cornersOf(kind, this.all[kind][i]).map((one, k) => (k === corner ? to : one));
    return this.set(kind, i, withCorners(kind, this.all[kind][i], corners));
  }

  set(kind, i, row) {
    return this.#change(
      kind,
      this.all[kind].map((one, k) => (k === i ? row : one)),
      i,
    );
  }

  remove(kind, i) {
    return this.#change(
      kind,
      this.all[kind].filter((_, k) => k !== i),
      null,
    );
  }

  select(selected) {
    this.selected = selected;
    this.emit("changed");
  }

  async undo() {
    this.selected = null;
    await this.connection.request({ type: "undo_places" }).catch(this.notifications.showError);
  }

  // Adds all places of a map file to those that there are; one of the same name is replaced.
  async load(text) {
    const read = await this.connection.request({ type: "read_places", text });
    const names = new Set(read.place.map(({ name }) => name));
    const kept = { ...this.all, place: this.all.place.filter(({ name }) => !names.has(name)) };
    await this.#send(Object.fromEntries(Object.keys(KINDS).map((kind) => [kind, [...kept[kind], ...read[kind]]])));
  }

  #freeName() {
    const names = new Set(this.all.place.map(({ name }) => name));
    let n = 1;
    while (names.has(`place-${n}`)) n += 1;
    return `place-${n}`;
  }

  async #change(kind, rows, selected) {
    try {
      await this.#send({ ...this.all, [kind]: rows });
      this.selected = selected === null ? null : [kind, selected];
      this.emit("changed");
      return null;
    } catch (error) {
      this.notifications.showError(error);
      return error.message;
    }
  }

  #send(all) {
    const places = Object.fromEntries(Object.keys(KINDS).map((kind) => [kind, all[kind]]));
    return this.connection.request({ type: "set_places", places });
  }

  #show(message) {
    this.all = { ...NONE, ...message };
    if (this.selected && this.selected[1] >= this.all[this.selected[0]].length) this.selected = null;
    this.emit("changed");
  }
}
