// @ts-check
// Teleoperation with a deadman: sends a velocity at 20 Hz while a control is held, and zero as soon as it is released,
// the page loses focus, is hidden or left, a pointer or gamepad disappears, or the network stalls. The robot's process
// stops by itself 250 ms after the last message; this code stops it sooner.

import { Emitter } from "./emitter.js";

const EVERY_MS = 50;

/** @extends {Emitter<{ refused: [string]; changed: [string | null] }>} */
export class Teleoperation extends Emitter {
  /** @type {Map<string, { v: number; w: number }>} */
  #held = new Map(); // held control → {v, w}, each from -1 to 1
  /** @type {number | undefined} */
  #timer = undefined;
  limit = 0.5;

  /** @param {Pick<Parts, "connection" | "run">} parts */
  constructor({ connection, run }) {
    super();
    this.connection = connection;
    this.run = run;
    addEventListener("blur", () => this.stop("the window lost the focus"));
    addEventListener("pagehide", () => this.stop("the page was left"));
    document.addEventListener("visibilitychange", () => document.hidden && this.stop("the page was hidden"));
    connection.on("closed", () => this.stop("the connection was lost"));
    connection.on("refused", (refusal) => this.stop(refusal.message)); // as of a velocity that arrived late
    run.on("mode", ({ mode }) => mode !== "DRIVE" && this.stop(`the mode is ${mode.replace("_", " ")}`));
  }

  get holding() {
    return this.#held.size > 0;
  }

  refusalReason() {
    if (!this.connection.open) return "there is no connection";
    if (!document.hasFocus()) return "the window does not have the focus"; // a gamepad would drive all the same
    if (this.run.watchesRecording) return "a recording is shown: go back to the live run first";
    if (!this.run.state.controller) return "this page only watches: ask for control first";
    if (this.run.robot.mode !== "DRIVE") return "the robot is not armed";
    return null;
  }

  // Starts or changes a held velocity; emits the reason if it is refused.
  /** @param {string} source @param {number} v @param {number} w */
  hold(source, v, w) {
    const why = this.refusalReason();
    if (why !== null) {
      this.emit("refused", why);
      return false;
    }
    const begins = this.#held.size === 0;
    this.#held.set(source, { v, w });
    if (begins) {
      this.#timer = setInterval(() => this.#send(), EVERY_MS);
      this.#send();
    }
    this.emit("changed", null);
    return true;
  }

  /** @param {string} source */
  release(source) {
    if (!this.#held.delete(source)) return;
    if (this.#held.size === 0) this.#end(null);
    else this.emit("changed", null);
  }

  /** @param {string} why */
  stop(why) {
    if (this.#held.size === 0) return;
    this.#held.clear();
    this.#end(why);
  }

  /** @param {string | null} why */
  #end(why) {
    clearInterval(this.#timer);
    this.connection.send({ type: "teleoperate", v: 0, w: 0 });
    this.emit("changed", why);
  }

  velocity() {
    const { speed_max = 0, turn_max = 0 } = this.run.session?.body ?? {};
    let v = 0,
      w = 0;
    for (const held of this.#held.values()) {
      v += held.v;
      w += held.w;
    }
    /** @param {number} share */
    const clamp = (share) => Math.max(-1, Math.min(1, share)) * this.limit;
    return { v: clamp(v) * speed_max, w: clamp(w) * turn_max };
  }

  #send() {
    if (this.connection.congested) {
      this.stop("the network stalls");
      return;
    }
    const { v, w } = this.velocity();
    this.connection.send({ type: "teleoperate", v, w });
  }
}
