// @ts-check
// The status bar: one state for the whole page, which always names the robot's own mode; its reason, the age of the
// data, line counters. Changes of the state are announced to screen readers.

import { byId, setAttribute, setText } from "./dom.js";
import { Panel } from "./panel.js";
import { degrees, percent } from "./units.js";

const STALE_S = 2.5; // while the robot does not answer, updates come once a second
const RECENT_MS = 5000;
/** @type {Record<string, string>} */
const ICONS = { "NO DATA": "m-connecting", PLAYBACK: "i-play", PAUSED: "i-pause" };
const SILENT_S = 3; // the text changes seldom, so that a screen reader does not repeat it all the time

export class Status extends Panel {
  #announce = byId("announce");
  /** @type {string | null} */
  #announced = null;
  /** @type {number | null} */
  #closed = null;
  /** @type {string | null} */
  #trouble = null; // why there is no connection, where that is known
  #silent = false;
  /** @type {string | null} */
  #version = null;
  #was_open = false;
  /** @type {Map<string, { count: number; at: number }>} */
  #counts = new Map();

  /** @param {Panels & Pick<Parts, "alerts" | "askForToken">} parts */
  constructor(parts) {
    super(parts);
    const { run, connection, notifications, alerts } = parts;
    this.askForToken = parts.askForToken;
    this.alerts = alerts;
    alerts.on("changed", () => this.#show());
    run.on("session", (session) => {
      setText(byId("robot-name"), session.name || "echolocate");
      setAttribute(byId("robot-name"), "title", session.name || "echolocate"); // a long name is cut
      // The page's own files are those of the program that served it.
      this.#version ??= session.version;
      notifications.banner(
        "version",
        session.version === this.#version ? null : "The robot's program was replaced by another version.",
        { buttons: [["Reload the page", () => location.reload()]] },
      );
      this.#show();
    });
    run.on("state", () => {
      this.#facts();
      this.#show();
    });
    run.on("mode", (robot) => this.#preparation(robot));
    connection.on("open", () => {
      this.#was_open = true;
      this.#closed = this.#trouble = null;
      notifications.banner("connection", null);
    });
    connection.on("closed", ({ opened }) => this.#lost(opened));
    setInterval(() => this.#age(), 200);
    const facts = byId("facts"); // on a phone they scroll sideways, by keys too
    new ResizeObserver(() =>
      facts.scrollWidth > facts.clientWidth ? setAttribute(facts, "tabindex", 0) : facts.removeAttribute("tabindex"),
    ).observe(facts);
  }

  get #isOld() {
    return this.#closed !== null || this.run.age(performance.now()) > STALE_S;
  }

  #show() {
    const { robot } = this.run;
    const old = this.#isOld,
      mode = robot.mode.replace("_", " ");
    const special = old ? "NO DATA" : this.run.watchesRecording ? "PLAYBACK" : robot.paused ? "PAUSED" : null;
    const reason = old ? (this.#trouble ?? "") : (reasonOf(robot) ?? "");
    const named =
      special === null || robot.mode === "no data" ? "" : old ? `the robot was in ${mode}` : `the robot: ${mode}`;
    setAttribute(byId("mode"), "data-mode", special === null ? robot.mode : special.replace(" ", "_"));
    setAttribute(byId("mode-icon"), "href", `#${special === null ? `m-${robot.mode.toLowerCase()}` : ICONS[special]}`);
    setText(byId("mode-name"), special ?? mode);
    setText(byId("mode-robot"), named);
    setText(byId("reason"), reason);
    document.body.classList.toggle("old", old);
    setAttribute(
      byId("facts"),
      "aria-label",
      this.run.watchesRecording ? "State in the recording" : "State of the run",
    );
    if (old) fact("twist", "unknown");
    const warnings = this.alerts.unseen > 0 ? `(${this.alerts.unseen}) ` : "";
    const title = `${warnings}${special ?? mode} · ${this.run.session?.name || "robot"} · echolocate`;
    if (document.title !== title) document.title = title;
    // A reason that counts is announced once, not each second; that data are missing is announced by #age and #lost.
    const kind = `${special ?? ""} ${mode} ${reason}`.replace(/\d+/g, "");
    if (kind !== this.#announced && !old) {
      const shown = special === null ? `Mode ${mode.toLowerCase()}` : `${special.toLowerCase()}, ${named}`;
      setText(this.#announce, `${shown}${reason ? `: ${reason}` : ""}`);
    }
    this.#announced = kind;
  }

  // The bar has no room for the progress, which counts.
  /** @param {Robot} robot */
  #preparation(robot) {
    const { mode } = robot,
      reason = reasonOf(robot);
    const preparing = mode === "CONNECTING" && Boolean(reason?.startsWith("recognition is being prepared"));
    this.notifications.banner("preparation", preparing ? "Recognition is being prepared." : null);
    this.notifications.updateBanner("preparation", `The robot stands: ${reason}.`);
  }

  #facts() {
    const { twist, localized, flags, link, dropped, late, missed, controller } = this.run.state;
    const { clients, recording } = this.run.robot;
    const turn = Math.round((twist[1] * 180) / Math.PI);
    const sense = turn < 0 ? "↻" : turn > 0 ? "↺" : "";
    fact("twist", `${this.units.number(twist[0])} ${this.units.name}/s ${sense} ${Math.abs(turn)}°/s`);
    byId("place").hidden = localized === null;
    if (localized !== null) fact("place", this.#place(localized), localized.status === "lost");
    if (link === null) fact("link", "not recorded");
    else fact("link", `${link.bad} / ${link.lost}`, this.#hasGrown("link", link.bad + link.lost));
    fact("flags", flags.join(", ").toLowerCase() || "none", flags.length > 0);
    fact("dropped", String(dropped), this.#hasGrown("dropped", dropped));
    if (late === null) fact("late", "not recorded");
    else fact("late", `${late} / ${missed}`, this.#hasGrown("late", late + (missed ?? 0)));
    fact("clients", String(clients));
    fact("role", controller ? "control" : "watch");
    const size = recording
      ? `${(recording.bytes / 1e6).toFixed(1)} MB${recording.dropped ? `, ${recording.dropped} lost` : ""}`
      : "off";
    fact("recording", recording ? `● ${size}` : size, recording !== null && recording.dropped > 0);
  }

  // With one standard deviation: of the place in its worst direction, and of the heading.
  /** @param {LocalizedRow} localized */
  #place({ pose: [x, y, theta], covariance, status, probability }) {
    const said = `${status} ${percent(probability)}`;
    // What is likely wrong has no place, however exact it would be.
    if (covariance === null || (status !== "tracking" && probability < 0.5)) return `unknown, ${said}`;
    const [xx, xy, yy, heading] = covariance;
    const sigma = Math.sqrt((xx + yy) / 2 + Math.hypot((xx - yy) / 2, xy));
    const place = `${this.units.number(x)}, ${this.units.number(y)} ${this.units.spread(sigma)}`;
    return `${place}, ${degrees(theta, Math.sqrt(heading))}, ${said}`;
  }

  // Whether a count has grown recently: one bad frame an hour ago does not matter now.
  /** @param {string} name @param {number} count */
  #hasGrown(name, count) {
    const known = this.#counts.get(name);
    const now = performance.now();
    if (known === undefined || count < known.count) this.#counts.set(name, { count, at: -Infinity });
    else if (count > known.count) this.#counts.set(name, { count, at: now });
    return now - (this.#counts.get(name)?.at ?? -Infinity) < RECENT_MS;
  }

  #age() {
    const age = this.run.age(performance.now());
    const quiet = age > STALE_S;
    if (this.#isOld !== document.body.classList.contains("old")) this.#show();
    // The moment shown of a recording has an age of years; whether the robot answers is in the state.
    if (this.run.watchesRecording) fact("age", "a recording", quiet);
    else fact("age", age === Infinity ? "none" : age < 1 ? `${age.toFixed(1)} s` : `${Math.round(age)} s`, quiet);
    if (this.#closed === null) {
      const text = `No update for ${Math.round(age)} s: what you see is old.`;
      const silent = quiet && age > SILENT_S && age !== Infinity;
      if (silent && !this.#silent) setText(this.#announce, "No update: what you see is old");
      this.#silent = silent;
      this.notifications.banner("stale", silent ? "No update: what you see is old." : null, { bad: true });
      this.notifications.updateBanner("stale", text);
    }
  }

  // A browser does not report why a websocket was rejected; a plain request to the same address does.
  /** @param {boolean} opened */
  async #lost(opened) {
    if (this.#closed === null) setText(this.#announce, "Connection lost");
    this.#closed ??= performance.now();
    this.#show();
    this.notifications.banner("stale", null);
    const lost = "No connection to the robot's process; trying again. The base stops by itself without commands.";
    if (opened) {
      this.notifications.banner("connection", lost, { bad: true });
      return;
    }
    const status = await this.connection.probe();
    if (this.connection.open) return;
    if (status === 401 || status === 403) {
      const why = this.#was_open ? "The run was started again with another token" : "The token is missing or wrong";
      this.notifications.banner(
        "connection",
        `${why}: open the address that the run printed when it started, or enter its token.`,
        { bad: true, buttons: [["Enter the token", this.askForToken]] },
      );
      this.connection.retryLater();
      this.#trouble = "token missing or wrong";
      this.#show();
    } else this.notifications.banner("connection", lost, { bad: true });
  }
}

/** @param {Robot} robot */
function reasonOf({ reason, arming, hold_reason: hold }) {
  return reason ?? (arming ? "arming…" : hold);
}

/** @param {string} name @param {string} text */
function fact(name, text, bad = false) {
  const element = byId(`fact-${name}`);
  setText(element, text);
  element.parentElement?.classList.toggle("bad", bad);
}
