// Modes, who controls, and what is driven: arm, disarm, HALT, hand-over, goal; and the words beside driving by hand.

import { byId, mark, say, writesText } from "./dom.js";
import { watchGamepad, watchKeys, watchPad } from "./hands.js";

export class Drive {
  constructor({ world, units, connection, notices, hand, tools }) {
    Object.assign(this, { world, units, connection, notices, hand });
    const asks = {
      arm: () => this.arm(), disarm: { type: "disarm" }, "take-control": { type: "take_control" },
      "give-control": { type: "release_control" }, "drive-request-legs": { type: "legs" },
    };
    for (const [id, message] of Object.entries(asks)) {
      byId(id).addEventListener("click", typeof message === "function" ? message : () => this.#ask(message));
    }
    byId("halt").addEventListener("click", () => this.halt());
    byId("drive-request-goal").addEventListener("click", () => tools.choose("goal", { focus: true }));
    byId("goal-form").addEventListener("submit", (event) => this.#goalByForm(event));
    world.on("session", () => {
      this.controller = undefined; // there may be new fields, to be shut for who watches
    });
    world.on("state", () => this.#refresh());
    world.on("role", (message) => this.#role(message));
    world.on("mode", (state) => this.#mode(state));
    units.on("changed", () => say(byId("goal-unit"), units.name));
    this.#byHand();
  }

  #ask(message) {
    return this.connection.ask(message).catch(this.notices.refused);
  }

  arm() {
    return this.#ask({ type: "arm" });
  }

  halt() {
    this.connection.halt().catch((error) => this.notices.toast(error.answered ? `HALT: ${error.message}`
      : "HALT could not be sent: no connection. Use the emergency stop on the base; it is sent as soon as there is one."));
    this.hand.stop("HALT");
  }

  goal(x, y) {
    return this.connection.ask({ type: "goal", x, y });
  }

  #goalByForm(event) {
    event.preventDefault();
    const error = byId("goal-error");
    const [x, y] = [byId("goal-x"), byId("goal-y")].map((input) => this.units.parse(input.value));
    if (x === null || y === null) {
      say(error, "two numbers are wanted");
      return;
    }
    this.goal(x, y).then(() => say(error, ""), (refusal) => say(error, refusal.message));
  }

  #mode({ mode, reason }) {
    const { controller } = this.world.state;
    say(byId("arm"), mode === "SAFE_STOP" ? "Re-arm" : "Arm");
    if (mode === "SAFE_STOP" || mode === "FAULT") {
      const buttons = mode === "SAFE_STOP" && controller ? [["Re-arm", () => this.arm()]] : [];
      this.notices.banner("stopped", `${mode === "FAULT" ? "Fault" : "Stopped"}: ${reason ?? "no reason given"}`, { bad: true, buttons });
    } else this.notices.banner("stopped", null);
  }

  #refresh() {
    const { mode, controller, drive_request, clients } = this.world.state;
    if (this.controller !== controller) {
      this.controller = controller;
      for (const element of document.querySelectorAll(".control")) element.disabled = !controller;
      this.#mode(this.world.state);
      if (!controller) this.hand.stop("somebody else controls");
      this.notices.banner("watching", controller ? null : "You are watching.", { buttons: [
        ["Ask for control", () => this.#ask({ type: "take_control" })], ["Just watch", () => this.notices.banner("watching", null)],
      ] });
      if (controller) this.notices.banner("asked", null);
    }
    byId("arm").disabled = !controller || mode === "DRIVE" || mode === "FAULT";
    byId("disarm").disabled = !controller || mode !== "DRIVE";
    byId("take-control").disabled = controller;
    byId("give-control").disabled = !controller;
    mark(byId("pad"), "aria-disabled", this.hand.whyNot() !== null);
    const others = clients - 1;
    say(byId("role-words"), `${controller ? "You control; " : "You watch; "}${others > 0 ? `${others} other${others > 1 ? "s" : ""} connected.` : "nobody else is connected."}`);
    say(byId("drive-request-words"), driveRequestText(drive_request, this.units));
    mark(byId("drive-request-legs"), "aria-pressed", drive_request?.kind === "legs");
    mark(byId("drive-request-goal"), "aria-pressed", drive_request?.kind === "goal");
  }

  #role({ asked_by: name, client }) {
    if (name === null || name === undefined) {
      this.notices.banner("asked", null);
      return;
    }
    this.notices.banner("asked", `${typeof name === "number" ? `Client ${name}` : name} asks for control.`, { buttons: [
      ["Hand over", () => {
        this.notices.banner("asked", null);
        this.#ask({ type: "grant_control", client: client ?? name });
      }],
      ["Keep it", () => this.notices.banner("asked", null)],
    ] });
  }

  #byHand() {
    const { hand } = this;
    const keys = byId("hand-keys"), limit = byId("hand-limit");
    watchPad(hand);
    watchKeys(hand, () => keys.checked, () => writesText(document.activeElement));
    watchGamepad(hand, (words) => say(byId("hand-gamepad"), words));
    const setLimit = () => {
      hand.limit = Number(limit.value) / 100;
      say(byId("hand-limit-value"), `${limit.value} %`);
    };
    limit.addEventListener("input", setLimit);
    setLimit();
    hand.on("refused", (why) => this.notices.toast(`Not driven: ${why}`));
    hand.on("changed", (why) => {
      const state = byId("hand-state");
      mark(state, "data-held", hand.holding);
      if (hand.holding) {
        const { v, w } = hand.velocity();
        say(state, `held: ${this.units.number(v)} ${this.units.name}/s, ${Math.round((w * 180) / Math.PI)}°/s`);
      } else say(state, why ? `let go: ${why}` : "not held: standing");
    });
  }
}

function driveRequestText(drive_request, units) {
  if (!drive_request) return "Nothing is known of it.";
  if (drive_request.kind === "goal" && drive_request.reached) return `At the goal at ${units.place(drive_request.x, drive_request.y)}.`;
  if (drive_request.kind === "goal") return `To the goal at ${units.place(drive_request.x, drive_request.y)}.`;
  return drive_request.kind === "teleoperate" ? "By hand." : "Ahead, as configured.";
}
