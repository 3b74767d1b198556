// @ts-check
// The known room: a map that is loaded while the robot stands, forgotten, and the robot's place in it said by numbers.

import { messageOf } from "./connection.js";
import { byId, disable, setText } from "./dom.js";
import { Panel } from "./panel.js";
import { numberIn, radians } from "./units.js";

/** @type {Record<string, string>} */
const STATUS = {
  tracking: "the robot knows its place there",
  localizing: "the robot looks for its place: drive a little, or say where it is",
  lost: "the robot has lost its place: say where it is, or drive on",
};

export class MapFile extends Panel {
  /** @param {Panels & Pick<Parts, "tools">} parts */
  constructor(parts) {
    super(parts);
    const { run, units, notifications, tools } = parts;
    byId("map-load").addEventListener("change", () => this.#load(byId("map-load")));
    byId("map-forget").addEventListener("click", () =>
      this.#set(null).then(
        (done) =>
          done && notifications.toast("The map is forgotten; positions are relative to the start of the run again"),
      ),
    );
    byId("map-here").addEventListener("click", () => tools.choose("here", { focus: true }));
    byId("here-form").addEventListener("submit", (event) => this.#here(event));
    run.on("state", () => this.#refresh());
    units.on("changed", () => setText(byId("here-unit"), units.name));
  }

  #refresh() {
    const { localized } = this.run.state,
      room = this.run.session?.known_room;
    const { enabled } = this;
    const isDriving = this.run.robot.mode === "DRIVE";
    const text = room
      ? `There is a map: ${STATUS[localized?.status ?? ""] ?? "it is being taken up"}.`
      : "No map is loaded: positions are relative to the start of the run.";
    setText(byId("map-known"), isDriving && enabled ? `${text} Disarm the robot to load or forget a map.` : text);
    byId("map-load").disabled = !enabled || isDriving;
    byId("map-forget").disabled = !enabled || isDriving || !room;
    byId("map-here").disabled = !enabled || !room;
    disable(byId("here-form").elements, !enabled || !room);
  }

  /** @param {string | null} toml */
  async #set(toml) {
    try {
      await this.connection.request({ type: "load_map", toml }, 600_000);
      setText(byId("map-error"), "");
      return true;
    } catch (error) {
      setText(
        byId("map-error"),
        messageOf(error).replace(
          "the message is too long",
          "the file is too long for the page: start the run with --map FILE",
        ),
      );
      return false;
    }
  }

  // As after a start with --map: the robot looks for its place, or the operator says where it is.
  /** @param {HTMLInputElement} input */
  async #load(input) {
    const file = input.files?.[0];
    if (!file) return;
    if (await this.#set(await file.text())) {
      this.notifications.toast(
        `${file.name} is the map now: drive a little until the robot knows its place, or say where it is`,
      );
    }
    input.value = "";
  }

  /** @param {SubmitEvent} event */
  #here(event) {
    event.preventDefault();
    const [x, y] = [byId("here-x"), byId("here-y")].map((input) => this.units.parse(input.value));
    const heading = numberIn(byId("here-heading").value) ?? 0;
    if (x === null || y === null || Number.isNaN(heading)) {
      setText(byId("map-error"), "two numbers are wanted, and a heading in degrees");
      return;
    }
    this.connection.request({ type: "place_robot", x, y, theta: radians(heading) }).then(
      () => {
        setText(byId("map-error"), "");
        this.notifications.toast("The next readings check this place");
      },
      (error) => setText(byId("map-error"), error.message),
    );
  }
}
