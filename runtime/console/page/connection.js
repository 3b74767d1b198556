// The one websocket: reconnects by itself, matches answers to what was asked, and knows when the line is congested.

import { Emitter } from "./emitter.js";

const RETRY_FIRST_MS = 250;
const RETRY_MAX_MS = 4000;
const ANSWER_MAX_MS = 10_000;
const SILENCE_MAX_MS = 10_000;
const MESSAGE_MAX = 65_536;
// Numbers in a recording are not those of the live map, and what it shows is not where the robot is.
const LIVE_ONLY = new Set([
  "arm", "legs", "goal", "teleoperate", "delete_segments", "pin_segments", "place_model", "move_object", "reject_object",
  "confirm_object", "clear_map", "evidence",
]);
// More than this unsent means that the network stalls: what is sent now would move the robot at some later time.
const CONGESTED_BYTES = 4096;

export class Refusal extends Error {
  constructor(message, { field = null, answered = true } = {}) {
    super(message);
    this.field = field;
    this.answered = answered; // or nobody knows whether it arrived
  }
}

export class Connection extends Emitter {
  #address;
  #socket = null;
  #next = 1;
  #asked = new Map();
  #retry_ms = RETRY_FIRST_MS;
  #timer = null;
  #heard_ms = 0;
  #halting = false;
  #probing = false;
  showsRecording = () => false;

  constructor(address) {
    super();
    this.#address = address;
    setInterval(() => this.#notice(), 1000);
  }

  get open() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  get congested() {
    return this.open && this.#socket.bufferedAmount > CONGESTED_BYTES;
  }

  connect() {
    clearTimeout(this.#timer);
    const socket = new WebSocket(this.#address);
    this.#socket = socket;
    this.#heard_ms = performance.now();
    let opened = false;
    socket.onopen = () => {
      opened = true;
      this.#retry_ms = RETRY_FIRST_MS;
      if (this.#halting) this.halt().catch(() => {});
      this.emit("open");
    };
    socket.onmessage = (event) => this.#hear(event.data);
    socket.onclose = (event) => {
      if (this.#socket !== socket) return;
      this.#socket = null;
      for (const { refuse, timer } of this.#asked.values()) {
        clearTimeout(timer);
        refuse(new Refusal("the connection was lost before an answer came", { answered: false }));
      }
      this.#asked.clear();
      this.emit("closed", { opened, reason: event.reason, code: event.code });
      this.#timer = setTimeout(() => this.connect(), this.#retry_ms);
      this.#retry_ms = Math.min(2 * this.#retry_ms, RETRY_MAX_MS);
    };
  }

  // Sends a message and resolves to its answer's data; rejects with a Refusal that says why not.
  ask(message, patience_ms = ANSWER_MAX_MS) {
    return new Promise((resolve, refuse) => {
      const id = this.#put(message, refuse);
      if (id === null) return;
      const timer = setTimeout(() => {
        this.#asked.delete(id);
        refuse(new Refusal(`no answer to "${message.type}" in ${patience_ms / 1000} s`, { answered: false }));
      }, patience_ms);
      this.#asked.set(id, { resolve, refuse, timer });
    });
  }

  // Sends a message whose answer nobody waits for; says whether it went out.
  post(message) {
    return this.#put(message, () => {}) !== null;
  }

  // A HALT of which nobody knows whether it arrived is sent again, first thing once there is a connection.
  async halt() {
    this.#halting = true;
    try {
      await this.ask({ type: "halt" });
      this.#halting = false;
    } catch (error) {
      this.#halting = !error.answered;
      throw error;
    }
  }

  // The status with which the same address answers a plain request; null where nobody answers.
  async probe() {
    try {
      const address = this.#address.replace(/^ws/, "http");
      return (await fetch(address, { cache: "no-store" })).status;
    } catch {
      return null;
    }
  }

  #put(message, refuse) {
    if (!this.open) {
      refuse(new Refusal("there is no connection to the robot's process", { answered: false }));
      return null;
    }
    if (LIVE_ONLY.has(message.type) && this.showsRecording() && !(message.v === 0 && message.w === 0)) {
      refuse(new Refusal("you look at a recording: go back to the live run first"));
      return null;
    }
    const id = this.#next++;
    const text = JSON.stringify({ id, ...message });
    if (text.length > MESSAGE_MAX) {
      refuse(new Refusal("that is too long to be sent"));
      return null;
    }
    this.#socket.send(text);
    return id;
  }

  #hear(text) {
    this.#heard_ms = performance.now();
    let message;
    try {
      message = JSON.parse(text);
    } catch {
      return;
    }
    if (message.type === "answer") this.#settle(message);
    else this.emit(message.type, message);
  }

  #settle({ id, ok, error, field, data }) {
    const asked = this.#asked.get(id);
    if (asked === undefined) {
      if (!ok) this.emit("refused", new Refusal(error ?? "refused", { field }));
      return;
    }
    this.#asked.delete(id);
    clearTimeout(asked.timer);
    if (ok) asked.resolve(data ?? null);
    else asked.refuse(new Refusal(error ?? "refused", { field }));
  }

  // A laptop that slept leaves a socket that looks open and is not. Silence alone says nothing, a recording may be held:
  // so something harmless is asked, and who does not answer that either is gone.
  #notice() {
    if (!this.open || performance.now() - this.#heard_ms < SILENCE_MAX_MS || this.#probing) return;
    this.#probing = true;
    const socket = this.#socket;
    this.ask({ type: "save_toml" }).catch((error) => {
      if (!error.answered) socket.close();
    }).finally(() => {
      this.#probing = false;
    });
  }
}
