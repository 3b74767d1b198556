// Driving by hand with a dead-man: a velocity goes out at 20 Hz for as long as somebody holds something, and zero as
// soon as nobody does, the page loses the focus, is hidden or left, a pointer or gamepad goes away, or the network
// stalls. The base stops by itself 250 ms after the last message; this is for stopping sooner.

import { Emitter } from "./emitter.js";

const EVERY_MS = 50;

export class Teleoperation extends Emitter {
  #held = new Map(); // what is held → {v, w}, each from -1 to 1
  #timer = null;
  limit = 0.5;

  constructor({ connection, world }) {
    super();
    Object.assign(this, { connection, world });
    addEventListener("blur", () => this.stop("the window lost the focus"));
    addEventListener("pagehide", () => this.stop("the page was left"));
    document.addEventListener("visibilitychange", () => document.hidden && this.stop("the page was hidden"));
    connection.on("closed", () => this.stop("the connection was lost"));
    world.on("mode", ({ mode }) => mode !== "DRIVE" && this.stop(`the mode is ${mode.replace("_", " ")}`));
  }

  get holding() {
    return this.#held.size > 0;
  }

  whyNot() {
    if (!this.connection.open) return "there is no connection";
    if (!document.hasFocus()) return "the window has not the focus"; // a gamepad would drive all the same
    if (this.world.watchesRecording) return "you look at a recording: go back to the live run";
    if (!this.world.state.controller) return "you watch: ask for control first";
    if (this.world.state.mode !== "DRIVE") return "it is not armed";
    return null;
  }

  // Holds on to a velocity; says why not where that is refused.
  hold(source, v, w) {
    const why = this.whyNot();
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

  release(source) {
    if (!this.#held.delete(source)) return;
    if (this.#held.size === 0) this.#end(null);
    else this.emit("changed", null);
  }

  stop(why) {
    if (this.#held.size === 0) return;
    this.#held.clear();
    this.#end(why);
  }

  #end(why) {
    clearInterval(this.#timer);
    this.#timer = null;
    this.connection.post({ type: "teleoperate", v: 0, w: 0 });
    this.emit("changed", why);
  }

  velocity() {
    const { speed_max = 0, turn_max = 0 } = this.world.session?.body ?? {};
    let v = 0, w = 0;
    for (const held of this.#held.values()) {
      v += held.v;
      w += held.w;
    }
    const clamp = (share) => Math.max(-1, Math.min(1, share)) * this.limit;
    return { v: clamp(v) * speed_max, w: clamp(w) * turn_max };
  }

  #send() {
    if (this.connection.congested) {
      this.stop("the network stalls");
      return;
    }
    const { v, w } = this.velocity();
    this.connection.post({ type: "teleoperate", v, w });
  }
}
