// The status bar: mode and reason, age of the data, line counters; announces changes of mode to screen readers.

import { byId, setAttribute, setText } from "./dom.js";
import { degrees } from "./units.js";

const STALE_S = 2.5; // while the robot does not answer, updates come once a second
const RECENT_MS = 5000;
const SILENT_S = 3; // the text changes seldom, so that a screen reader does not repeat it all the time

export class Status {
  #run;
  #units;
  #connection;
  #notifications;
  #announce = byId("announce");
  #announced = null;
  #closed = null;
  #silent = false;
  #counts = new Map();

  constructor({ run, units, connection, notifications }) {
    [this.#run, this.#units, this.#connection, this.#notifications] = [run, units, connection, notifications];
    run.on("session", (session) => {
      setText(byId("robot-name"), session.name || "echolocate");
      document.title = `${session.name || "robot"} · echolocate`;
    });
    run.on("state", () => this.#facts());
    run.on("mode", (state) => this.#mode(state));
    connection.on("open", () => {
      this.#closed = null;
      notifications.banner("connection", null);
    });
    connection.on("closed", ({ opened }) => this.#lost(opened));
    setInterval(() => this.#age(), 200);
  }

  #mode({ mode, reason: why, hold_reason, arming }) {
    const reason = why ?? (arming ? "arming…" : hold_reason);
    setAttribute(byId("mode"), "data-mode", mode);
    setAttribute(byId("mode-icon"), "href", `#m-${mode.toLowerCase()}`);
    setText(byId("mode-name"), `${this.#run.watchesRecording ? "then: " : ""}${mode.replace("_", " ")}`);
    setText(byId("reason"), reason ?? "");
    // The bar has no room for the progress, which counts.
    const preparing = mode === "CONNECTING" && Boolean(reason?.startsWith("recognition is being prepared"));
    this.#notifications.banner("preparation", preparing ? "Recognition is being prepared." : null);
    this.#notifications.updateBanner("preparation", `The robot stands: ${reason}.`);
    // A reason that counts is announced once, not each second.
    const kind = `${mode} ${reason ?? ""}`.replace(/\d+/g, "");
    if (kind !== this.#announced) setText(this.#announce, `Mode ${mode.replace("_", " ").toLowerCase()}${reason ? `: ${reason}` : ""}`);
    this.#announced = kind;
  }

  #facts() {
    const { twist, localized, flags, link, dropped, late, missed, clients, controller, recording } = this.#run.state;
    const turn = Math.round((twist[1] * 180) / Math.PI);
    fact("twist", `${this.#units.number(twist[0])} ${this.#units.name}/s ${turn < 0 ? "↻" : turn > 0 ? "↺" : ""} ${Math.abs(turn)}°/s`);
    byId("place").hidden = localized === null;
    if (localized !== null) fact("place", this.#place(localized), localized.status === "lost");
    fact("link", link ? `${link.bad} / ${link.lost}` : "none", this.#hasGrown("link", link ? link.bad + link.lost : 0));
    fact("flags", flags.join(", ").toLowerCase() || "none", flags.length > 0);
    fact("dropped", String(dropped), this.#hasGrown("dropped", dropped));
    fact("late", `${late} / ${missed}`, this.#hasGrown("late", late + missed));
    fact("clients", String(clients));
    fact("role", controller ? "control" : "watch");
    const size = recording ? `${(recording.bytes / 1e6).toFixed(1)} MB${recording.dropped ? `, ${recording.dropped} lost` : ""}` : "off";
    fact("recording", recording ? `● ${size}` : size, recording?.dropped > 0);
  }

  // With one standard deviation: of the place in its worst direction, and of the heading.
  #place({ pose: [x, y, theta], covariance, status, probability }) {
    const said = `${status} ${Math.round(100 * probability)} %`;
    if (covariance === null) return `unknown, ${said}`;
    const [xx, xy, yy, heading] = covariance;
    const sigma = Math.sqrt((xx + yy) / 2 + Math.hypot((xx - yy) / 2, xy));
    const place = `${this.#units.number(x)}, ${this.#units.number(y)} ± ${this.#units.length(sigma, 3)}`;
    return `${place}, ${degrees(theta)} ± ${((Math.sqrt(heading) * 180) / Math.PI).toFixed(1)}°, ${said}`;
  }

  // Whether a count has grown recently: one bad frame an hour ago does not matter now.
  #hasGrown(name, count) {
    const known = this.#counts.get(name);
    const now = performance.now();
    if (known === undefined || count < known.count) this.#counts.set(name, { count, at: -Infinity });
    else if (count > known.count) this.#counts.set(name, { count, at: now });
    return now - this.#counts.get(name).at < RECENT_MS;
  }

  #age() {
    const age = this.#run.age(performance.now());
    const quiet = age > STALE_S && !this.#run.state.paused && !this.#run.watchesRecording;
    fact("age", age === Infinity ? "none" : age < 1 ? `${age.toFixed(1)} s` : `${Math.round(age)} s`, quiet);
    if (this.#closed === null) {
      const text = `No update for ${Math.round(age)} s: what you see is old.`;
      const silent = quiet && age > SILENT_S && age !== Infinity;
      if (silent && !this.#silent) setText(this.#announce, "No update: what you see is old");
      this.#silent = silent;
      this.#notifications.banner("stale", silent ? "No update: what you see is old." : null, { bad: true });
      this.#notifications.updateBanner("stale", text);
    }
  }

  // A browser does not report why a websocket was rejected; a plain request to the same address does.
  async #lost(opened) {
    if (this.#closed === null) setText(this.#announce, "Connection lost");
    this.#closed ??= performance.now();
    this.#notifications.banner("stale", null);
    const lost = "No connection to the robot's process; trying again. The base stops by itself without commands.";
    if (opened) {
      this.#notifications.banner("connection", lost, { bad: true });
      return;
    }
    const status = await this.#connection.probe();
    if (this.#connection.open) return;
    if (status === 401 || status === 403) {
      this.#notifications.banner("connection", "The token is missing or wrong: open the address that the run printed when it started.", { bad: true });
      setText(byId("reason"), "token missing or wrong");
    } else this.#notifications.banner("connection", lost, { bad: true });
  }
}

function fact(name, text, bad = false) {
  const element = byId(`fact-${name}`);
  setText(element, text);
  element.parentElement.classList.toggle("bad", Boolean(bad));
}
