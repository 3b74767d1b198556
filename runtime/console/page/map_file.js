// The known room: a map that is loaded while the robot stands, forgotten, and the robot's place in it said by numbers.

import { byId, setText } from "./dom.js";

const STATUS = {
  tracking: "the robot knows its place there",
  localizing: "the robot looks for its place: drive a little, or say where it is",
  lost: "the robot has lost its place: say where it is, or drive on",
};

export class MapFile {
  constructor({ run, units, connection, notifications, tools }) {
    Object.assign(this, { run, units, connection, notifications, tools });
    byId("map-load").addEventListener("change", (event) => this.#load(event.target));
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
    const { localized, controller } = this.run.state,
      { known_room: room } = this.run.session ?? {};
    const enabled = controller && !this.run.watchesRecording;
    const isDriving = this.run.robot.mode === "DRIVE";
    const text = room
      ? `There is a map: ${STATUS[localized?.status] ?? "it is being taken up"}.`
      : "No map is loaded: positions are relative to the start of the run.";
    setText(byId("map-known"), isDriving && enabled ? `${text} Disarm the robot to load or forget a map.` : text);
    byId("map-load").disabled = !enabled || isDriving;
    byId("map-forget").disabled = !enabled || isDriving || !room;
    byId("map-here").disabled = !enabled || !room;
    for (const element of byId("here-form").elements) element.disabled = !enabled || !room;
  }

  async #set(toml) {
    try {
      await this.connection.request({ type: "load_map", toml }, 600_000);
      setText(byId("map-error"), "");
      return true;
    } catch (error) {
      setText(
        byId("map-error"),
        error.message.replace(
          "the message is too long",
          "the file is too long for the page: start the run with --map FILE",
        ),
      );
      return false;
    }
  }

  // As after a start with --map: the robot looks for its place, or the operator says where it is.
  async #load(input) {
    const [file] = input.files;
    if (!file) return;
    if (await this.#set(await file.text())) {
      this.notifications.toast(
        `${file.name} is the map now: drive a little until the robot knows its place, or say where it is`,
      );
    }
    input.value = "";
  }

  #here(event) {
    event.preventDefault();
    const [x, y] = ["here-x", "here-y"].map((id) => this.units.parse(byId(id).value));
    const heading = Number(byId("here-heading").value.trim().replace("−", "-") || "0");
    if (x === null || y === null || Number.isNaN(heading)) {
      setText(byId("map-error"), "two numbers are wanted, and a heading in degrees");
      return;
    }
    this.connection.request({ type: "place_robot", x, y, theta: (heading * Math.PI) / 180 }).then(
      () => {
        setText(byId("map-error"), "");
        this.notifications.toast("The next readings check this place");
      },
      (error) => setText(byId("map-error"), error.message),
    );
  }
}
