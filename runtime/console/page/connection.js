// @ts-check
// The websocket: reconnects, matches answers to requests, and detects congestion.

import { Emitter } from "./emitter.js";

const RETRY_FIRST_MS = 250;
const RETRY_MAX_MS = 4000;
const RETRY_REFUSED_MS = 60_000; // a page whose token is wrong: only a new run with the same one would take it
const ANSWER_MAX_MS = 10_000;
const SILENCE_MAX_MS = 10_000;
// A HALT without an answer for this long is reported as not confirmed, and sent again over a new connection.
const HALT_CONFIRM_MS = 500;
const HALT_ANSWER_MS = 3000;
const MESSAGE_MAX = 65_536; // bytes: a longer message ends the connection
// Refused while a recording is shown: its object numbers and poses are not those of the live run.
/** @type {Set<keyof Commands>} */
const LIVE_ONLY = new Set([
  "arm",
  "legs",
  "goal",
  "teleoperate",
  "start_mission",
  "run_mission",
  "set_route",
  "resume_mission",
  "skip_step",
  "delete_segments",
  "pin_segments",
  "place_model",
  "move_object",
  "reject_object",
  "confirm_object",
  "lift_area",
  "undo_edit",
  "clear_map",
  "evidence",
  "place_robot",
  "load_map",
  "set_places",
  "undo_places",
  "go_to_place",
]);
// Carried out by a cycle, so that in a paused run they wait for the next one, however long that takes.
/** @type {Set<keyof Commands>} */
const EDITS = new Set([
  "delete_segments",
  "pin_segments",
  "place_model",
  "move_object",
  "confirm_object",
  "reject_object",
  "lift_area",
  "undo_edit",
  "clear_map",
  "place_robot",
]);
// With more than this unsent the network is stalled: a command sent now would move the robot too late.
const CONGESTED_BYTES = 4096;

export class RequestError extends Error {
  /** @param {string} message @param {{ field?: string | null; answered?: boolean }} more */
  constructor(message, { field = null, answered = true } = {}) {
    super(message);
    this.field = field;
    this.answered = answered; // false: it is unknown whether the message arrived
  }
}

// What is wrong, of an error of any kind.
/** @param {unknown} error */
export const messageOf = (error) => (error instanceof Error ? error.message : String(error));

/**
 * @typedef {object} ConnectionEvents
 * @property {[]} open
 * @property {[{ opened: boolean; reason: string; code: number }]} closed
 * @property {[number]} waiting
 * @property {[boolean]} halt
 * @property {[RequestError]} refused
 */

/** @extends {Emitter<ConnectionEvents & { [K in keyof Messages]: [Messages[K]] }>} */
export class Connection extends Emitter {
  #address;
  /** @type {WebSocket | null} */
  #socket = null;
  #next = 1;
  /** @type {Map<number, Pending>} */
  #pending = new Map();
  #retry_ms = RETRY_FIRST_MS;
  /** @type {number | undefined} */
  #timer = undefined;
  #received_ms = 0;
  /** @type {number | undefined} */
  #challenge = undefined; // the newest of the server; a command that can begin a motion is refused without a fresh one
  #halting = false;
  /** @type {number | undefined} */
  #unconfirmed = undefined;
  #probing = false;
  /** @type {Promise<Answers["list_recordings"]> | null} */
  #recordings = null; // the list that is on its way
  refused = false; // the run has refused this page's token
  showsRecording = () => false;
  isPaused = () => false;

  /** @param {string} address */
  constructor(address) {
    super();
    this.#address = address;
    setInterval(() => this.#checkSilence(), 1000);
  }

  get open() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  get congested() {
    return this.open && (this.#socket?.bufferedAmount ?? 0) > CONGESTED_BYTES;
  }

  connect() {
    clearTimeout(this.#timer);
    const socket = new WebSocket(this.#address);
    this.#socket = socket;
    this.#received_ms = performance.now();
    let opened = false;
    socket.onopen = () => {
      opened = true;
      this.refused = false;
      this.#retry_ms = RETRY_FIRST_MS;
      if (this.#halting) this.halt().catch(() => {});
      this.emit("open");
    };
    socket.onmessage = (event) => this.#onMessage(event.data);
    socket.onclose = (event) => this.#lose(socket, opened, event);
  }

  // The end of a connection; of one that hangs, whose own end may take a minute, before it has ended.
  /** @param {WebSocket} socket @param {boolean} opened @param {{ reason?: string; code?: number }} event */
  #lose(socket, opened = true, { reason = "", code = 0 } = {}) {
    if (this.#socket !== socket) return;
    this.#socket = null;
    this.#challenge = undefined;
    for (const { refuse, timer } of this.#pending.values()) {
      clearTimeout(timer);
      refuse(new RequestError("the connection was lost before an answer came", { answered: false }));
    }
    this.#pending.clear();
    this.#countWaiting();
    this.emit("closed", { opened, reason, code });
    this.#timer = setTimeout(() => this.connect(), this.#retry_ms);
    this.#retry_ms = Math.min(2 * this.#retry_ms, RETRY_MAX_MS);
    socket.close();
  }

  // Sends a message and resolves to its answer's data; rejects with a RequestError that says why not.
  /** @template {keyof Commands} K @param {Ask<K>} message @returns {Promise<Answers[K]>} */
  request(message, timeout_ms = ANSWER_MAX_MS) {
    return new Promise((resolve, refuse) => {
      const id = this.#transmit(message, refuse);
      if (id === null) return;
      const waits = EDITS.has(message.type) && this.isPaused();
      const timer = waits
        ? undefined
        : setTimeout(() => {
            this.#pending.delete(id);
            refuse(new RequestError(`no answer to "${message.type}" in ${timeout_ms / 1000} s`, { answered: false }));
          }, timeout_ms);
      this.#pending.set(id, { resolve: (data) => resolve(/** @type {Answers[K]} */ (data)), refuse, timer, waits });
      if (waits) this.#countWaiting();
    });
  }

  // Resolves to the list of recordings: one answer for all panels that ask at once, as the run takes one request of this
  // kind from a page at a time.
  recordings() {
    this.#recordings ??= this.request({ type: "list_recordings" }).finally(() => {
      this.#recordings = null;
    });
    return this.#recordings;
  }

  #countWaiting() {
    this.emit("waiting", [...this.#pending.values()].filter(({ waits }) => waits).length);
  }

  // Sends a message without waiting for its answer; returns whether it was sent.
  /** @template {keyof Commands} K @param {Ask<K>} message */
  send(message) {
    return this.#transmit(message, () => {}) !== null;
  }

  // A HALT is sent until it is answered: again as the first message of the next connection, and over a new one where
  // this one hangs. "halt" is emitted with false when it is not confirmed in time, with true when it is.
  async halt() {
    const socket = this.open ? this.#socket : null;
    if (!this.#halting)
      this.#unconfirmed = setTimeout(() => this.emit("halt", false), socket === null ? 0 : HALT_CONFIRM_MS);
    this.#halting = true;
    try {
      await this.request({ type: "halt" }, HALT_ANSWER_MS);
      this.#halted();
    } catch (error) {
      if (error instanceof RequestError && error.answered) this.#halted();
      else if (socket !== null) this.#lose(socket);
      throw error;
    }
  }

  #halted() {
    clearTimeout(this.#unconfirmed);
    this.#halting = false;
    this.emit("halt", true);
  }

  // Ask less often from now on, until a connection opens.
  retryLater() {
    this.refused = true;
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.connect(), RETRY_REFUSED_MS);
  }

  // The HTTP status of a plain request to the same address; null without an answer.
  async probe() {
    try {
      const address = this.#address.replace(/^ws/, "http");
      return (await fetch(address, { cache: "no-store" })).status;
    } catch {
      return null;
    }
  }

  /** @param {{ type: keyof Commands; v?: number; w?: number }} message @param {(why: RequestError) => void} refuse */
  #transmit(message, refuse) {
    if (this.#socket === null || !this.open) {
      refuse(new RequestError("there is no connection to the robot's process", { answered: false }));
      return null;
    }
    if (LIVE_ONLY.has(message.type) && this.showsRecording() && !(message.v === 0 && message.w === 0)) {
      refuse(new RequestError("a recording is shown: go back to the live run first"));
      return null;
    }
    const id = this.#next++;
    const text = JSON.stringify({ id, challenge: this.#challenge, ...message });
    if (new TextEncoder().encode(text).length > MESSAGE_MAX) {
      refuse(new RequestError("the message is too long"));
      return null;
    }
    this.#socket.send(text);
    return id;
  }

  /** @param {string} text */
  #onMessage(text) {
    this.#received_ms = performance.now();
    /** @type {Messages[keyof Messages]} */
    let message;
    try {
      message = JSON.parse(text);
    } catch {
      return;
    }
    if (message.type === "answer") this.#resolve(message);
    else if (message.type === "challenge") this.#challenge = message.number;
    else this.emit(message.type, ...[/** @type {never} */ (message)]);
  }

  /** @param {AnswerMessage} answer */
  #resolve({ id, ok, error, field, data }) {
    const pending = id === null ? undefined : this.#pending.get(id);
    if (id === null || pending === undefined) {
      if (!ok) this.emit("refused", new RequestError(error ?? "refused", { field }));
      return;
    }
    this.#pending.delete(id);
    clearTimeout(pending.timer);
    if (pending.waits) this.#countWaiting();
    if (ok) pending.resolve(data ?? null);
    else pending.refuse(new RequestError(error ?? "refused", { field }));
  }

  // After a laptop's sleep a socket can look open and be dead. Silence alone proves nothing, because playback may be
  // paused: so send a harmless request, and close the socket if that is not answered either.
  #checkSilence() {
    if (!this.open || performance.now() - this.#received_ms < SILENCE_MAX_MS || this.#probing) return;
    this.#probing = true;
    const socket = this.#socket;
    this.request({ type: "save_toml" })
      .catch((error) => {
        if (socket !== null && error instanceof RequestError && !error.answered) this.#lose(socket);
      })
      .finally(() => {
        this.#probing = false;
      });
  }
}
