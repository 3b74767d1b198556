// @ts-check
// Warnings that should reach a person who looks elsewhere: counted on the Log tab and in the window's title until the
// log is looked at, and heard if one wants.

import { byId, setAttribute, setText } from "./dom.js";
import { Emitter } from "./emitter.js";
import { prefer, preferred } from "./preferences.js";
import { counted } from "./units.js";

const QUIET_MS = 3000; // many warnings at once are one sound
const TONE_S = 0.12;
const TONES_HZ = { warning: [660], error: [660, 440, 660] };
const STOPS = new Set(["SAFE_STOP", "FAULT"]);

/** @extends {Emitter<{ changed: [number] }>} */
export class Alerts extends Emitter {
  unseen = 0;
  #sound = byId("log-sound");
  /** @type {AudioContext | null} */
  #audio = null;
  #heard_ms = -Infinity;
  /** @type {string | null} */
  #mode = null;

  // `seen` says whether the log is being looked at.
  /** @param {Pick<Parts, "run" | "connection"> & { seen: () => boolean }} parts */
  constructor({ run, connection, seen }) {
    super();
    this.seen = seen;
    this.#sound.checked = preferred("sound", false);
    this.#sound.addEventListener("change", () => {
      prefer("sound", this.#sound.checked);
      this.#heard_ms = -Infinity;
      this.#play("warning"); // so one knows what to listen for
    });
    // After a reload a browser plays nothing before the page was touched.
    for (const touch of ["pointerdown", "keydown"])
      addEventListener(touch, () => this.#audio?.resume(), { capture: true });
    run.on("log", ({ level }) => (level === "warning" || level === "error") && this.#take(level));
    run.on("mode", ({ mode }) => {
      if (this.#mode !== null && mode !== this.#mode && STOPS.has(mode)) this.#play("error");
      this.#mode = mode;
    });
    connection.on("closed", ({ opened }) => opened && this.#play("error"));
    document.addEventListener("visibilitychange", () => this.look());
  }

  /** @param {"warning" | "error"} level */
  #take(level) {
    this.#play(level);
    this.unseen++;
    this.#show();
    this.look();
  }

  // What is on the screen now has been seen.
  look() {
    if (this.unseen === 0 || document.hidden || !this.seen()) return;
    this.unseen = 0;
    this.#show();
  }

  #show() {
    const badge = byId("log-badge"),
      words = counted(this.unseen, "new warning");
    badge.hidden = this.unseen === 0;
    setText(badge, this.unseen > 99 ? "99+" : String(this.unseen));
    if (this.unseen > 0) setAttribute(byId("tab-log"), "title", words);
    else byId("tab-log").removeAttribute("title");
    this.emit("changed", this.unseen);
  }

  /** @param {"warning" | "error"} kind */
  #play(kind) {
    const now = performance.now();
    if (!this.#sound.checked || now - this.#heard_ms < QUIET_MS || !globalThis.AudioContext) return;
    this.#heard_ms = now;
    this.#audio ??= new AudioContext();
    const audio = this.#audio;
    void audio.resume();
    TONES_HZ[kind].forEach((hz, i) => {
      const from = audio.currentTime + 1.3 * TONE_S * i;
      const tone = audio.createOscillator(),
        loud = audio.createGain();
      tone.frequency.value = hz;
      loud.gain.setValueAtTime(0.2, from);
      loud.gain.exponentialRampToValueAtTime(0.001, from + TONE_S);
      tone.connect(loud).connect(audio.destination);
      tone.start(from);
      tone.stop(from + TONE_S);
    });
  }
}
