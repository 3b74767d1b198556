// @ts-check
// The time panel: pause, single-step and speed of the emulator, recording, and playback.

import { button, byId, disable, download, el, setAttribute, setText } from "./dom.js";
import { base } from "./files.js";
import { Pace, paceText } from "./pace.js";
import { Panel } from "./panel.js";
import { context } from "./theme.js";
import { countObjects } from "./walls.js";

const OPEN_MAX_MS = 600_000;
const DOUBLE_MS = 600; // the second press of a double click comes within this

/** @param {number} s */
const clock = (s) => `${s.toFixed(1)} s`;

export class Time extends Panel {
  /** @type {string | null} */
  #file = null; // the recording that is open
  /** @type {SessionMessage | null} */
  #liveSession = null; // the live run's greeting meanwhile
  #scrubbing = false;
  #marked_ms = -Infinity;
  #pace = new Pace(); // of the emulator
  #playPace = new Pace();

  /** @param {Panels & { shoot: () => void }} parts */
  constructor(parts) {
    super(parts);
    const { run, connection, notifications } = parts;
    /** @param {string} id @param {() => unknown} act */
    const on = (id, act) => byId(id).addEventListener("click", act);
    on("pause", () => this.pause());
    on("single-step", () => this.ask({ type: "single_step" }));
    on("record", () => this.ask({ type: "record", on: run.robot.recording === null }));
    on("recordings-again", () => this.#list(notifications.showError));
    on("open", () => this.#open());
    on("play", () => this.ask({ type: "play_recording", speed: this.#playing ? 0 : Number(byId("play-speed").value) }));
    on("play-step", () => this.ask({ type: "step_recording", cycles: 1 }));
    on("play-back", () => this.ask({ type: "step_recording", cycles: -1 }));
    on("live", () => this.#backToLive());
    on("screenshot", () => parts.shoot());
    byId("speed").addEventListener("change", () =>
      this.ask({ type: "set_speed", factor: Number(byId("speed").value) }),
    );
    byId("play-speed").addEventListener(
      "change",
      () => this.#playing && this.ask({ type: "play_recording", speed: Number(byId("play-speed").value) }),
    );
    byId("bookmark-form").addEventListener("submit", (event) => this.#bookmark(event));
    on("bookmark-undo", () => this.undo());
    const scrub = byId("scrub");
    scrub.addEventListener("input", () => this.#scrub(Number(scrub.value)));
    scrub.addEventListener("change", () => this.#scrub(Number(scrub.value)));
    run.on("state", () => this.#refresh());
    connection.on("session", (session) => {
      if (this.#liveSession !== null) this.#liveSession = session;
    });
    connection.on("opening", ({ share }) =>
      this.notifications.updateBanner("opening", `Opening the recording: ${Math.round(100 * share)} %`),
    );
    connection.on("closed", () => this.#discard()); // a new connection shows the live run
  }

  // Request the list when the panel is first shown.
  shown() {
    if (byId("recordings").options.length === 0) this.#list();
  }

  get #playing() {
    return this.run.state.playback?.is_playing ?? false;
  }

  pause() {
    return this.ask({ type: this.run.robot.paused ? "resume" : "pause" });
  }

  #refresh() {
    const { robot_s, host_s, cycle, mode, reason, playback, controller } = this.run.state;
    const { paused, speed, recording } = this.run.robot;
    const emulated = (this.#liveSession ?? this.run.session)?.emulated ?? false;
    const at = `${clock(robot_s)}, cycle ${cycle}`;
    const then = `in ${mode.replace("_", " ")}${reason ? ` (${reason})` : ""}`;
    const goes = emulated && playback === null && !paused ? speed : null;
    const reached = this.#pace.measure(robot_s, host_s, goes);
    const played = this.#playPace.measure(
      playback?.s ?? 0,
      performance.now() / 1000,
      playback?.is_playing ? playback.speed : null,
    );
    const pace = speed !== 1 || reached !== null ? `, ${paceText(speed, reached)}` : "";
    const live = `${emulated ? "Live, in the emulator" : "Live"}: ${at}${paused ? ", paused" : ""}${pace}`;
    const plays = playback?.is_playing ? `, ${paceText(playback.speed, played)}` : "";
    setText(
      byId("time-text"),
      playback ? `Recording ${base(this.#file)}${plays}: ${at}, the robot then ${then}` : live,
    );
    setText(byId("pause"), paused ? "Resume" : "Pause");
    disable([byId("pause"), byId("single-step"), byId("speed")], !controller || !emulated || playback !== null);
    if (document.activeElement !== byId("speed")) choose(byId("speed"), String(speed));
    setAttribute(byId("record"), "aria-pressed", recording !== null);
    setText(byId("record-text"), recording ? `to ${base(recording.file)}` : "off");
    if (playback) this.#follow(playback);
    this.notifications.banner(
      "playback",
      playback ? `This is a recording, not the live run: ${base(this.#file)}` : null,
      { buttons: [["Back to the live run", () => this.#backToLive()]] },
    );
  }

  /** @param {Pick<PlaybackRow, "s" | "is_playing">} playback */
  #follow({ s, is_playing: playing }) {
    const scrub = byId("scrub");
    if (!this.#scrubbing) {
      scrub.value = String(s);
      setText(byId("scrub-value"), clock(s));
      setAttribute(scrub, "aria-valuetext", clock(s));
    }
    setText(byId("play"), playing ? "Hold" : "Play");
  }

  async #backToLive() {
    if ((await this.ask({ type: "close_recording" })) === undefined) return;
    if (this.#liveSession !== null) this.run.beginSession(this.#liveSession);
    this.#discard();
  }

  #discard() {
    this.#file = this.#liveSession = null;
    byId("playback").hidden = true;
  }

  /** @param {(error: unknown) => void} refused */
  async #list(refused = () => {}) {
    const chooser = byId("recordings"),
      chosen = chooser.value;
    let list;
    try {
      list = await this.connection.recordings();
    } catch (error) {
      refused(error);
      return;
    }
    chooser.replaceChildren(
      ...list.map(({ file, bytes, live }) => {
        const size = bytes === null ? "" : `, ${(bytes / 1e6).toFixed(1)} MB`;
        return el("option", { value: file }, live ? `this run, up to now` : `${base(file)}${size}`);
      }),
    );
    if ([...chooser.options].some(({ value }) => value === chosen)) chooser.value = chosen;
  }

  async #open() {
    const file = byId("recordings").value;
    if (!file) {
      this.notifications.toast("There is no recording to open");
      return;
    }
    await this.openFile(file, OPEN_MAX_MS);
  }

  // Shows a recording in place of the live run; returns whether it is open.
  /** @param {string} file */
  async openFile(file, timeout_ms = OPEN_MAX_MS) {
    let data;
    const busy = [byId("open"), byId("file-play")];
    this.notifications.banner("opening", `Opening ${base(file)} …`);
    disable(busy, true);
    try {
      data = await this.connection.request({ type: "open_recording", file }, timeout_ms);
    } catch (error) {
      this.notifications.showError(error);
      return false;
    } finally {
      this.notifications.banner("opening", null);
      disable(busy, false);
    }
    this.#file = file;
    byId("playback").hidden = false;
    byId("scrub").max = String(data.duration_s);
    /** @type {Array<[number, string]>} */
    const places = [
      ...data.bookmarks.map(([s, text]) => /** @type {[number, string]} */ ([s, `✎ ${text}`])),
      ...data.modes.map(([s, mode, reason]) => /** @type {[number, string]} */ ([s, said(mode, reason)])),
    ];
    byId("bookmarks").replaceChildren(
      ...places
        .sort(([a], [b]) => a - b)
        .map(([s, text]) =>
          el(
            "li",
            {},
            button(`${clock(s)}  ${text}`, () => this.#scrub(s)),
          ),
        ),
    );
    this.#liveSession ??= this.run.session;
    if (this.#liveSession !== null)
      // the recording may be of another robot with other models
      this.run.beginSession({ ...this.#liveSession, ...data.about, parameters: this.#liveSession.parameters });
    this.#follow({ s: 0, is_playing: false });
    return true;
  }

  // While the slider is dragged, one request at a time: the newest position after the answer to the previous one.
  /** @type {number | null} */
  #wanted = null;
  /** @param {number} s */
  async #scrub(s) {
    setText(byId("scrub-value"), clock(s));
    this.#wanted = s;
    if (this.#scrubbing) return;
    this.#scrubbing = true;
    while (this.#wanted !== null) {
      const to = this.#wanted;
      this.#wanted = null;
      await this.ask({ type: "seek_recording", s: to });
    }
    this.#scrubbing = false;
  }

  /** @param {SubmitEvent} event */
  #bookmark(event) {
    event.preventDefault();
    const input = byId("bookmark-text"),
      now = performance.now();
    if (now - this.#marked_ms < DOUBLE_MS) return;
    this.#marked_ms = now;
    const text = input.value.trim() || `cycle ${this.run.state.cycle}`;
    this.connection.request({ type: "bookmark", text }).then(() => {
      input.value = "";
      this.notifications.toast(`Bookmarked: ${text}`);
    }, this.notifications.showError);
  }

  async undo() {
    const text = await this.ask({ type: "undo_bookmark" });
    if (text !== undefined) this.notifications.toast(`No longer bookmarked: ${text}`);
  }
}

/** @param {string} mode @param {string | null} reason */
const said = (mode, reason) => `${mode.replace("_", " ")}${reason ? `: ${reason}` : ""}`;

/** @param {HTMLSelectElement} select @param {string} value */
function choose(select, value) {
  if ([...select.options].some((option) => option.value === value)) select.value = value;
}

// Saves the map as a picture with a caption: robot, time, mode.
/** @param {Pick<Parts, "view" | "run" | "theme" | "units"> & { scene: Scene }} parts */
export function screenshot({ scene, view, run, theme, units }) {
  const ratio = 2,
    foot = 34;
  const canvas = el("canvas");
  canvas.width = view.width * ratio;
  canvas.height = (view.height + foot) * ratio;
  const ctx = context(canvas);
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  scene.picture(ctx);
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.fillStyle = theme.panel;
  ctx.fillRect(0, view.height, view.width, foot);
  ctx.fillStyle = theme.ink;
  ctx.font = theme.font(13);
  ctx.textBaseline = "middle";
  const { robot_s, mode, cycle, objects } = run.state;
  const moment = `${run.session?.name ?? "robot"}, ${clock(robot_s)}, cycle ${cycle}, ${mode}`;
  const text = `${moment}, objects: ${countObjects(objects)}, in ${units.word}`;
  ctx.fillText(text, 12, view.height + foot / 2);
  canvas.toBlob((blob) => blob !== null && download(`echolocate-${robot_s.toFixed(1)}s.png`, blob));
}
