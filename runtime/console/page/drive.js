// @ts-check
// The drive panel: arm, disarm, HALT, handing control over, goals, and teleoperation.

import { byId, disable, setAttribute, setText, writesText } from "./dom.js";
import { Panel } from "./panel.js";
import { counted, numberIn, radians } from "./units.js";
import { inMap } from "./map_frame.js";
import { watchGamepad, watchKeys, watchPad } from "./drive_inputs.js";

export class Drive extends Panel {
  /** @type {boolean | undefined} */
  #enabled = undefined;
  /** @type {boolean | undefined} */
  #controller = undefined;

  /** @param {Panels & Pick<Parts, "teleoperation" | "tools" | "askForToken">} parts */
  constructor(parts) {
    super(parts);
    const { run, units, connection, notifications, tools } = parts;
    this.teleoperation = parts.teleoperation;
    this.tools = tools;
    this.askForToken = parts.askForToken;
    byId("arm").addEventListener("click", () => this.arm());
    byId("disarm").addEventListener("click", () => this.ask({ type: "disarm" }));
    byId("take-control").addEventListener("click", () => this.ask({ type: "take_control" }));
    byId("give-control").addEventListener("click", () => this.ask({ type: "release_control" }));
    byId("drive-request-legs").addEventListener("click", () => this.ask({ type: "legs" }));
    byId("halt").addEventListener("click", () => this.halt());
    connection.on("halt", (confirmed) =>
      notifications.banner(
        "halt",
        confirmed
          ? null
          : connection.refused
            ? "HALT not sent, as the run refuses this page's token: use the robot's own stop."
            : "HALT not confirmed: use the robot's own stop. It is sent again until the robot's process answers.",
        { bad: true },
      ),
    );
    byId("drive-request-goal").addEventListener("click", () => tools.choose("goal", { focus: true }));
    byId("goal-form").addEventListener("submit", (event) => this.#goalByForm(event));
    run.on("session", () => {
      this.#enabled = undefined; // new fields may have appeared, which must be disabled for observers
    });
    run.on("state", () => this.#refresh());
    run.on("role", (message) => this.#role(message));
    run.on("mode", () => this.#mode());
    units.on("changed", () => setText(byId("goal-unit"), units.name));
    this.#watchTeleoperation();
  }

  arm() {
    return this.ask({ type: "arm" });
  }

  halt() {
    this.connection.halt().catch((error) => error.answered && this.notifications.toast(`HALT: ${error.message}`));
    this.teleoperation.stop("HALT");
  }

  // Drives to a place of the plane; the final heading in radians, null for any.
  /** @param {number} x @param {number} y @param {number | null} heading */
  goal(x, y, heading = null) {
    const { localized } = this.run.state,
      there = inMap(localized, x, y);
    const turn = there.frame === "map" ? (localized?.frame[2] ?? 0) : 0;
    return this.connection.request({ type: "goal", ...there, heading: heading === null ? null : heading - turn });
  }

  /** @param {SubmitEvent} event */
  #goalByForm(event) {
    event.preventDefault();
    const error = byId("goal-error");
    const [x, y] = [byId("goal-x"), byId("goal-y")].map((input) => this.units.parse(input.value));
    const heading = radians(numberIn(byId("goal-heading").value));
    if (x === null || y === null || Number.isNaN(heading)) {
      setText(error, "two numbers are wanted, and a heading in degrees or none");
      return;
    }
    this.goal(x, y, heading).then(
      () => setText(error, ""),
      (refusal) => setText(error, refusal.message),
    );
  }

  // A stop of the robot is shown also beside a recording; arming requires the live run on the screen.
  #mode() {
    const { mode, reason } = this.run.robot;
    setText(byId("arm"), mode === "SAFE_STOP" ? "Re-arm" : "Arm");
    if (mode === "SAFE_STOP" || mode === "FAULT") {
      /** @type {Choice[]} */
      const buttons = mode === "SAFE_STOP" && this.#enabled ? [["Re-arm", () => this.arm()]] : [];
      const what = mode === "FAULT" ? "Fault" : "Stopped";
      const named = this.run.watchesRecording ? `The robot itself: ${what.toLowerCase()}` : what;
      this.notifications.banner("stopped", `${named}: ${reason ?? "no reason given"}`, { bad: true, buttons });
    } else this.notifications.banner("stopped", null);
  }

  #refresh() {
    const { controller, drive_request } = this.run.state;
    const { mode, clients } = this.run.robot;
    const { enabled } = this;
    if (this.#enabled !== enabled) {
      this.#enabled = enabled;
      disable(document.querySelectorAll(".control"), !enabled);
      this.tools.enable(enabled);
      this.#mode();
    }
    if (this.#controller !== controller) {
      this.#controller = controller;
      if (!controller) this.teleoperation.stop("another client controls");
      const mayAct = this.run.session?.has_token ?? true;
      this.notifications.banner(
        "watching",
        controller
          ? null
          : mayAct
            ? "You are watching."
            : "This page has no token, so it only watches; HALT does nothing here.",
        {
          buttons: [
            mayAct
              ? ["Ask for control", () => this.ask({ type: "take_control" })]
              : ["Enter the token", this.askForToken],
            ["Just watch", () => this.notifications.banner("watching", null)],
          ],
        },
      );
      if (controller) this.notifications.banner("asked", null);
    }
    byId("arm").disabled = !enabled || mode === "DRIVE" || mode === "FAULT";
    byId("disarm").disabled = !enabled || mode !== "DRIVE";
    const live = !this.run.watchesRecording;
    byId("take-control").disabled = controller || !live;
    byId("give-control").disabled = !controller || !live;
    setAttribute(byId("pad"), "aria-disabled", this.teleoperation.refusalReason() !== null);
    const others = clients > 1 ? `${counted(clients - 1, "other")} connected.` : "no other client is connected.";
    setText(byId("role-text"), `${controller ? "You control; " : "You watch; "}${others}`);
    setText(byId("drive-request-text"), driveRequestText(drive_request, this.units, this.run.state.localized));
    setAttribute(byId("drive-request-legs"), "aria-pressed", drive_request?.kind === "legs");
    setAttribute(byId("drive-request-goal"), "aria-pressed", drive_request?.kind === "goal");
  }

  /** @param {RoleMessage} message */
  #role({ asked_by: name, client }) {
    if (name === null || client === null) {
      this.notifications.banner("asked", null);
      return;
    }
    this.notifications.banner("asked", `${name} asks for control.`, {
      buttons: [
        [
          "Hand over",
          () => {
            this.notifications.banner("asked", null);
            void this.ask({ type: "grant_control", client });
          },
        ],
        ["Keep it", () => this.notifications.banner("asked", null)],
      ],
    });
  }

  #watchTeleoperation() {
    const { teleoperation } = this;
    const keys = byId("teleop-keys"),
      limit = byId("teleop-limit");
    watchPad(teleoperation);
    watchKeys(
      teleoperation,
      () => keys.checked,
      () => writesText(document.activeElement),
    );
    watchGamepad(teleoperation, (text) => setText(byId("teleop-gamepad"), text));
    const setLimit = () => {
      teleoperation.limit = Number(limit.value) / 100;
      setText(byId("teleop-limit-value"), `${limit.value} %`);
    };
    limit.addEventListener("input", setLimit);
    setLimit();
    teleoperation.on("refused", (why) => this.notifications.toast(`Not driven: ${why}`));
    teleoperation.on("changed", (why) => {
      const state = byId("teleop-state");
      setAttribute(state, "data-held", teleoperation.holding);
      if (teleoperation.holding) {
        const { v, w } = teleoperation.velocity();
        setText(state, `driving: ${this.units.number(v)} ${this.units.name}/s, ${Math.round((w * 180) / Math.PI)}°/s`);
      } else setText(state, why ? `stopped: ${why}` : "released: stopped");
    });
  }
}

/** @param {Shown["drive_request"]} drive_request @param {Units} units @param {Localized} localized */
function driveRequestText(drive_request, units, localized) {
  if (!drive_request) return "No drive request yet.";
  if (drive_request.kind === "goal") {
    const place = units.place(drive_request.x, drive_request.y) + (drive_request.frame === "map" ? " in the map" : "");
    const isAt = drive_request.reached && !(drive_request.frame === "map" && localized?.status === "lost");
    return `${isAt ? "At" : "To"} the goal at ${place}.`;
  }
  if (drive_request.kind === "mission") return `Mission ${drive_request.name}: ${drive_request.status}.`;
  return drive_request.kind === "teleoperate" ? "Teleoperation." : "Ahead, as configured.";
}
