// Time: hold the emulator, let it go on a cycle at a time or faster, record, and look at what was recorded.

import { byId, download, el, mark, say } from "./dom.js";

const clock = (s) => `${s.toFixed(1)} s`;

export class Time {
  #file = null; // the recording that is open
  #liveSession = null; // the live run's greeting meanwhile
  #scrubbing = false;

  constructor({ world, connection, notices, shoot }) {
    Object.assign(this, { world, connection, notices, shoot });
    const on = (id, act) => byId(id).addEventListener("click", act);
    on("pause", () => this.pause());
    on("single-step", () => this.#ask({ type: "single_step" }));
    on("record", () => this.#ask({ type: "record", on: world.state.recording === null }));
    on("recordings-again", () => this.#list(notices.refused));
    on("open", () => this.#open());
    on("play", () => this.#ask({ type: "play_recording", speed: this.#playing ? 0 : Number(byId("play-speed").value) }));
    on("play-step", () => this.#ask({ type: "step_recording", cycles: 1 }));
    on("play-back", () => this.#ask({ type: "step_recording", cycles: -1 }));
    on("live", () => this.#backToLive());
    on("screenshot", () => shoot());
    byId("speed").addEventListener("change", (event) => this.#ask({ type: "set_speed", factor: Number(event.target.value) }));
    byId("play-speed").addEventListener("change", (event) => this.#playing && this.#ask({ type: "play_recording", speed: Number(event.target.value) }));
    byId("bookmark-form").addEventListener("submit", (event) => this.#bookmark(event));
    const scrub = byId("scrub");
    scrub.addEventListener("input", () => this.#scrub(Number(scrub.value)));
    scrub.addEventListener("change", () => this.#scrub(Number(scrub.value)));
    world.on("state", () => this.#refresh());
    connection.on("session", (session) => {
      if (this.#liveSession !== null) this.#liveSession = session;
    });
    connection.on("closed", () => this.#forget()); // whoever comes back is shown the live run
  }

  // The list is asked for when somebody looks.
  shown() {
    if (byId("recordings").options.length === 0) this.#list();
  }

  #ask(message) {
    return this.connection.ask(message).catch((error) => this.notices.refused(error));
  }

  get #playing() {
    return this.world.state.playback?.is_playing ?? false;
  }

  pause() {
    return this.#ask({ type: this.world.state.paused ? "resume" : "pause" });
  }

  #refresh() {
    const { robot_s, cycle, paused, speed, recording, playback, controller } = this.world.state;
    const emulated = this.world.session?.emulated ?? false;
    const where = playback ? `Recording ${name(this.#file)}` : emulated ? "Live, in the emulator" : "Live";
    say(byId("time-words"), `${where}: ${clock(robot_s)}, cycle ${cycle}${paused ? ", paused" : ""}${speed !== 1 ? `, × ${speed}` : ""}`);
    say(byId("pause"), paused ? "Go on" : "Pause");
    for (const id of ["pause", "single-step", "speed"]) byId(id).disabled = !controller || !emulated;
    if (document.activeElement !== byId("speed")) choose(byId("speed"), String(speed));
    mark(byId("record"), "aria-pressed", recording !== null);
    say(byId("record-words"), recording ? `to ${name(recording.file)}` : "off");
    if (playback) this.#follow(playback);
    this.notices.banner("playback", playback ? `You look at a recording, not at the robot: ${name(this.#file)}` : null,
      { buttons: [["Back to the live run", () => this.#backToLive()]] });
  }

  #follow({ s, is_playing: playing }) {
    const scrub = byId("scrub");
    if (!this.#scrubbing) {
      scrub.value = String(s);
      say(byId("scrub-value"), clock(s));
      mark(scrub, "aria-valuetext", clock(s));
    }
    say(byId("play"), playing ? "Hold" : "Play");
  }

  async #backToLive() {
    if ((await this.#ask({ type: "close_recording" })) === undefined) return;
    if (this.#liveSession !== null) this.world.beginSession(this.#liveSession);
    this.#forget();
  }

  #forget() {
    this.#file = this.#liveSession = null;
    byId("player").hidden = true;
  }

  async #list(refused = () => {}) {
    const chooser = byId("recordings"), chosen = chooser.value;
    let list;
    try {
      list = await this.connection.ask({ type: "list_recordings" });
    } catch (error) {
      refused(error);
      return;
    }
    chooser.replaceChildren(...(list ?? []).map(({ file, bytes = null, live = false }) => {
      const size = bytes === null ? "" : `, ${(bytes / 1e6).toFixed(1)} MB`;
      return el("option", { value: file }, live ? `this run, up to now` : `${name(file)}${size}`);
    }));
    if ([...chooser.options].some(({ value }) => value === chosen)) chooser.value = chosen;
  }

  async #open() {
    const file = byId("recordings").value;
    if (!file) {
      this.notices.toast("There is no recording to open");
      return;
    }
    const data = await this.#ask({ type: "open_recording", file });
    if (data === undefined) return;
    this.#file = file;
    byId("player").hidden = false;
    byId("scrub").max = String(data?.duration_s ?? 1);
    const places = [...(data?.bookmarks ?? []).map(([s, text]) => [s, `✎ ${text}`]),
      ...(data?.modes ?? []).map(([s, mode, reason]) => [s, `${mode.replace("_", " ")}${reason ? `: ${reason}` : ""}`])];
    byId("bookmarks").replaceChildren(...places.sort(([a], [b]) => a - b).map(([s, words]) =>
      el("li", {}, el("button", { type: "button", onclick: () => this.#scrub(s) }, `${clock(s)}  ${words}`))));
    if (data?.about) { // another robot may have driven then, and found other things
      this.#liveSession ??= this.world.session;
      this.world.beginSession({ ...this.#liveSession, ...data.about, parameters: this.#liveSession.parameters });
    }
    this.#follow({ s: 0, is_playing: false });
  }

  // While the slider is dragged, one request at a time: the newest place after the answer to the one before.
  #wanted = null;
  async #scrub(s) {
    say(byId("scrub-value"), clock(s));
    this.#wanted = s;
    if (this.#scrubbing) return;
    this.#scrubbing = true;
    while (this.#wanted !== null) {
      const to = this.#wanted;
      this.#wanted = null;
      await this.#ask({ type: "seek_recording", s: to });
    }
    this.#scrubbing = false;
  }

  #bookmark(event) {
    event.preventDefault();
    const input = byId("bookmark-text");
    const text = input.value.trim() || `cycle ${this.world.state.cycle}`;
    this.connection.ask({ type: "bookmark", text }).then(() => {
      input.value = "";
      this.notices.toast(`Bookmarked: ${text}`);
    }, this.notices.refused);
  }
}

const name = (file) => String(file ?? "").split("/").at(-1);

function choose(select, value) {
  if ([...select.options].some((option) => option.value === value)) select.value = value;
}

// The map as a picture with a line that says what, when and in which mode.
export function screenshot({ scene, view, world, theme, units }) {
  const ratio = 2, foot = 34;
  const canvas = el("canvas");
  canvas.width = view.width * ratio;
  canvas.height = (view.height + foot) * ratio;
  const ctx = canvas.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  scene.picture(ctx, ratio);
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.fillStyle = theme.panel;
  ctx.fillRect(0, view.height, view.width, foot);
  ctx.fillStyle = theme.ink;
  ctx.font = theme.font(13);
  ctx.textBaseline = "middle";
  const { robot_s, mode, cycle, objects } = world.state;
  const words = `${world.session?.name ?? "robot"}, ${clock(robot_s)}, cycle ${cycle}, ${mode}, ${objects.length} objects, in ${units.word}`;
  ctx.fillText(words, 12, view.height + foot / 2);
  canvas.toBlob((blob) => download(`echolocate-${robot_s.toFixed(1)}s.png`, blob));
}
