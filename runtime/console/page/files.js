// @ts-check
// The recordings as files: the list with length, size and state; play, download, rename, pin, delete; and reports and
// maps that are made of them, with how far each is.

import { messageOf } from "./connection.js";
import { button, byId, disable, el, setText } from "./dom.js";
import { Panel } from "./panel.js";

const LONG = { report: "Report", map: "Map" };

// The name of a file without its folders.
/** @param {string | null} file */
export const base = (file) => (file ?? "").replace(/^.*\//s, "");

// 3725 s as "1 h 02 min", 65 s as "1 min 05 s".
/** @param {number | null} s */
export function duration(s) {
  if (s === null) return "length unknown";
  if (s < 60) return `${s.toFixed(1)} s`;
  /** @param {number} n */
  const two = (n) => String(Math.floor(n)).padStart(2, "0");
  return s < 3600
    ? `${Math.floor(s / 60)} min ${two(s % 60)} s`
    : `${Math.floor(s / 3600)} h ${two((s % 3600) / 60)} min`;
}

/** @param {number | null} bytes */
const size = (bytes) =>
  bytes === null ? "size unknown" : bytes < 1e6 ? `${Math.ceil(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
/** @param {number | null} unix_s */
const when = (unix_s) =>
  unix_s === null ? "" : new Date(1000 * unix_s).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
/** @param {ListedRecording} recording */
const state = ({ live, state: of }) =>
  live ? "this run, up to now" : of === "live" ? "being written" : of === "incomplete" ? "cut off" : "complete";

export class Files extends Panel {
  /** @type {ListedRecording[]} */
  #rows = [];
  /** @type {string | null} */
  #chosen = null;
  /** @type {Map<number, JobMessage>} */
  #jobs = new Map();
  /** @type {string | null | undefined} */
  #recording = undefined;
  #shown = "";

  /**
   * @param {Panels & {
   *   address: (path: string, given: Record<string, string>) => string;
   *   play: (file: string) => Promise<void>;
   *   showFiles: () => void;
   * }} parts
   */
  constructor(parts) {
    super(parts);
    const { run, connection, notifications } = parts;
    this.address = parts.address;
    this.play = parts.play;
    /** @param {string} id @param {() => unknown} act */
    const on = (id, act) => byId(id).addEventListener("click", act);
    on("files-again", () => this.list(notifications.showError));
    on("files-undo", () => this.undo());
    on("file-play", () => this.#play());
    on("file-report", () => this.#chosen && this.make("report", this.#chosen));
    on("file-map", () => this.#chosen && this.make("map", this.#chosen));
    on("file-pin", () => this.#pin());
    on("file-delete", () => this.#delete());
    on("map-make", () => this.#makeOfRun("map"));
    on("report", () => void this.#makeOfRun("report").then((started) => started && parts.showFiles()));
    byId("file-rename").addEventListener("submit", (event) => this.#rename(event));
    connection.on("job", (job) => this.#follow(job));
    connection.on("closed", () => this.#forgetJobs());
    connection.on("opening", ({ share }) => setText(byId("file-opening"), `Opening: ${Math.round(100 * share)} %`));
    connection.on("replay_problem", ({ error }) => this.#showProblem(error));
    run.on("state", () => this.#refresh());
  }

  // Request the lists when the panel is shown.
  shown() {
    this.list();
    this.connection.request({ type: "list_jobs" }).then(
      (jobs) => {
        for (const job of jobs.toReversed()) this.#follow(job, { quiet: true });
      },
      () => {},
    );
  }

  /** @param {(error: unknown) => void} refused */
  async list(refused = () => {}) {
    try {
      this.#rows = await this.connection.recordings();
    } catch (error) {
      refused(error);
      return;
    }
    if (!this.#rows.some(({ file }) => file === this.#chosen)) this.#chosen = null;
    this.#refresh();
  }

  get #row() {
    return this.#rows.find(({ file }) => file === this.#chosen) ?? null;
  }

  #refresh() {
    const { controller } = this.run.state,
      recording = this.run.robot.recording?.file ?? null;
    if (recording !== this.#recording && this.#recording !== undefined && !byId("panel-files").hidden) this.list();
    this.#recording = recording;
    const shown = JSON.stringify([this.#rows, this.#chosen, controller, this.run.watchesRecording]);
    if (shown === this.#shown) return;
    this.#shown = shown;
    const focused = document.activeElement?.id;
    byId("files-undo").disabled = !controller;
    setText(byId("files-count"), String(this.#rows.length));
    byId("files-empty").hidden = this.#rows.length > 0;
    byId("files").replaceChildren(...this.#rows.map((row, i) => el("li", {}, this.#line(row, i))));
    const row = this.#row;
    byId("file").hidden = row === null;
    if (focused?.startsWith("file-row-")) document.getElementById(focused)?.focus();
    if (row === null) return;
    const isLive = row.live || row.state === "live",
      inFolder = !row.file.includes("/");
    setText(byId("file-name"), base(row.file));
    const facts = [
      ["recorded", when(row.modified_s)],
      ["length", duration(row.duration_s)],
      ["size", size(row.bytes)],
      ["state", state(row)],
      ["when the folder is full", row.pinned ? "stays: it is pinned" : "may go, the oldest first"],
    ];
    byId("file-facts").replaceChildren(
      ...facts
        .filter(([, value]) => value !== "")
        .flatMap(([name, value]) => [el("dt", {}, name), el("dd", {}, value)]),
    );
    byId("file-download").href = this.address("/recording", { file: row.file });
    byId("file-new-name").value = base(row.file).replace(/\.mcap$/, "");
    setText(byId("file-error"), "");
    setText(byId("file-pin"), row.pinned ? "Unpin" : "Pin");
    byId("file-pin").disabled = !controller || !inFolder;
    disable([byId("file-new-name"), byId("file-rename-do"), byId("file-delete")], !controller || isLive || !inFolder);
  }

  /** @param {ListedRecording} row @param {number} i */
  #line(row, i) {
    const facts = [...(row.live ? [] : [duration(row.duration_s), size(row.bytes)]), state(row)];
    const content = [
      el("strong", {}, base(row.file)),
      el("span", {}, [...facts, ...(row.pinned ? ["pinned"] : [])].join(", ")),
    ];
    const more = { class: "file", id: `file-row-${i}`, "aria-pressed": String(row.file === this.#chosen) };
    return button(content, () => this.#choose(row.file), more);
  }

  #pin() {
    const row = this.#row;
    if (row !== null) void this.#change({ type: "pin_recording", file: row.file, pinned: !row.pinned });
  }

  /** @param {string} file */
  #choose(file) {
    this.#chosen = file === this.#chosen ? null : file;
    this.#refresh();
  }

  // What is wrong with the recording that is played stays on the page until it is closed.
  /** @param {string | null} text */
  #showProblem(text) {
    this.notifications.banner("recording", text, { bad: true, buttons: [["Close", () => this.#showProblem(null)]] });
  }

  async #play() {
    this.#showProblem(null);
    setText(byId("file-opening"), "Opening …");
    try {
      if (this.#chosen !== null) await this.play(this.#chosen);
    } finally {
      setText(byId("file-opening"), "");
    }
  }

  /** @template {"pin_recording" | "delete_recording"} K @param {Ask<K>} message */
  async #change(message) {
    try {
      await this.connection.request(message);
      setText(byId("file-error"), "");
      return true;
    } catch (error) {
      setText(byId("file-error"), messageOf(error));
      return false;
    } finally {
      await this.list();
    }
  }

  /** @param {SubmitEvent} event */
  async #rename(event) {
    event.preventDefault();
    const file = this.#chosen;
    if (file === null) return;
    const to = byId("file-new-name").value.trim();
    if (to === "") {
      setText(byId("file-error"), "a name is wanted here");
      return;
    }
    let name;
    try {
      name = await this.connection.request({ type: "rename_recording", file, to });
    } catch (error) {
      setText(byId("file-error"), messageOf(error));
      return;
    }
    this.#chosen = name;
    this.notifications.toast(`${file} is ${name} now`);
    await this.list();
  }

  // Takes back the last new name or pin, whichever recording it was of.
  async undo() {
    const done = await this.ask({ type: "undo_file" });
    if (done !== undefined) this.notifications.toast(done);
    await this.list();
  }

  #delete() {
    const row = this.#row;
    if (row === null) return;
    this.notifications.confirm(
      `Delete ${row.file}?`,
      el(
        "p",
        {},
        `${duration(row.duration_s)}, ${size(row.bytes)}. `,
        "It is deleted for good; download it first if it may be of use.",
      ),
      [
        ["Keep it", null],
        [
          "Delete it",
          () =>
            void this.#change({ type: "delete_recording", file: row.file }).then(
              (done) => done && this.notifications.toast(`${row.file} is deleted`),
            ),
        ],
      ],
    );
  }

  // Begins to make a report or a map; what becomes of it comes as messages.
  /** @param {JobMessage["kind"]} kind @param {string} file */
  async make(kind, file) {
    this.#showJob({ text: `${LONG[kind]} of ${base(file)}: asked for` });
    if ((await this.ask({ type: "make_files", kind, file })) === undefined) this.#showRunning();
  }

  /** @param {{ text: string; share?: number; cancel?: (() => unknown) | null }} job */
  #showJob({ text, share = 0, cancel = null }) {
    byId("job").hidden = false;
    setText(byId("job-text"), text);
    if (share > 0) byId("job-share").value = share;
    else byId("job-share").removeAttribute("value");
    byId("job-cancel").disabled = cancel === null;
    byId("job-cancel").onclick = cancel;
  }

  #showRunning() {
    const running = [...this.#jobs.values()].find(({ over }) => !over);
    byId("job").hidden = running === undefined;
    if (running === undefined) return;
    const { kind, file, what, share, job } = running;
    const done = share > 0 ? `, ${Math.round(100 * share)} %` : "";
    const cancel = () => this.ask({ type: "cancel_job", job });
    this.#showJob({ text: `${LONG[kind]} of ${base(file)}: ${what}${done}`, share, cancel });
  }

  // The next connection may be to another run, whose jobs have the same numbers.
  #forgetJobs() {
    this.#jobs.clear();
    this.#showRunning();
    this.#showMade();
  }

  // Returns whether there is a recording of this run.
  /** @param {JobMessage["kind"]} kind */
  async #makeOfRun(kind) {
    if (![...this.#jobs.values()].some(({ over }) => !over))
      this.#showJob({ text: `${LONG[kind]} of this run: looking for its recording` });
    await this.list(this.notifications.showError);
    const live = this.#rows.find((row) => row.live);
    if (!live) this.#showRunning();
    if (live) await this.make(kind, live.file);
    else
      this.notifications.toast(
        `This run is not being recorded, and its ${kind} is made from the recording: press Record in the tab Time`,
      );
    return live !== undefined;
  }

  /** @param {JobMessage} job */
  #follow(job, { quiet = false } = {}) {
    const was = this.#jobs.get(job.job);
    this.#jobs.set(job.job, job);
    this.#showRunning();
    if (!job.over || was?.over) return;
    this.#showMade();
    if (quiet) return;
    this.notifications.toast(
      job.error === null
        ? `${LONG[job.kind]} of ${base(job.file)}: ready in the tab Files`
        : `${LONG[job.kind]} of ${base(job.file)}: ${job.error}`,
    );
  }

  #showMade() {
    const made = [...this.#jobs.values()].filter((job) => job.made.length > 0);
    byId("made").replaceChildren(...made.reverse().map((done) => this.#made(done)));
    byId("made-part").hidden = made.length === 0;
  }

  /** @param {JobMessage} done */
  #made({ job, kind, file, made }) {
    return el(
      "li",
      {},
      el("span", {}, `${LONG[kind]} of ${base(file)}`),
      ...made.map((name) => {
        const isPage = name.endsWith(".html");
        return el(
          "a",
          {
            class: "button small",
            href: this.address("/made", { job: String(job), file: name }),
            ...(isPage ? { target: "_blank", rel: "noopener" } : { download: name }),
            "aria-label": `${isPage ? "Open" : "Download"} ${name}`,
          },
          isPage ? "Open" : name.replace(/^.*\./s, "").toUpperCase(),
        );
      }),
    );
  }
}
