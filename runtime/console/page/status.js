// The bar at the top: mode with its reason, how old the data are, the line, what was dropped; says changes of mode aloud.

import { byId, mark, say } from "./dom.js";

const STALE_S = 2.5; // of a robot that does not answer there are news once a second
const NEWS_MS = 5000;
const SILENT_S = 3; // the words change seldom, so that they can be read and are not read out all the time

export class Status {
  #world;
  #units;
  #connection;
  #notices;
  #said = byId("said");
  #closed = null;
  #silent = false;
  #counts = new Map();

  constructor({ world, units, connection, notices }) {
    [this.#world, this.#units, this.#connection, this.#notices] = [world, units, connection, notices];
    world.on("session", (session) => {
      say(byId("robot-name"), session.name || "echolocate");
      document.title = `${session.name || "robot"} · echolocate`;
    });
    world.on("state", () => this.#facts());
    world.on("mode", (state) => this.#mode(state));
    connection.on("open", () => {
      this.#closed = null;
      notices.banner("connection", null);
    });
    connection.on("closed", ({ opened }) => this.#lost(opened));
    setInterval(() => this.#age(), 200);
  }

  #mode({ mode, reason: why, hold_reason, arming }) {
    const reason = why ?? (arming ? "arming…" : hold_reason);
    mark(byId("mode"), "data-mode", mode);
    mark(byId("mode-icon"), "href", `#m-${mode.toLowerCase()}`);
    say(byId("mode-name"), `${this.#world.watchesRecording ? "then: " : ""}${mode.replace("_", " ")}`);
    say(byId("reason"), reason ?? "");
    say(this.#said, `Mode ${mode.replace("_", " ").toLowerCase()}${reason ? `: ${reason}` : ""}`);
  }

  #facts() {
    const { twist, flags, link, dropped, late, missed, clients, controller, recording } = this.#world.state;
    const turn = Math.round((twist[1] * 180) / Math.PI);
    fact("twist", `${this.#units.number(twist[0])} ${this.#units.name}/s ${turn < 0 ? "↻" : turn > 0 ? "↺" : ""} ${Math.abs(turn)}°/s`);
    fact("link", link ? `${link.bad} / ${link.lost}` : "none", this.#grows("link", link ? link.bad + link.lost : 0));
    fact("flags", flags.join(", ").toLowerCase() || "none", flags.length > 0);
    fact("dropped", String(dropped), this.#grows("dropped", dropped));
    fact("late", `${late} / ${missed}`, this.#grows("late", late + missed));
    fact("clients", String(clients));
    fact("role", controller ? "control" : "watch");
    const size = recording ? `${(recording.bytes / 1e6).toFixed(1)} MB${recording.dropped ? `, ${recording.dropped} lost` : ""}` : "off";
    fact("recording", recording ? `● ${size}` : size, recording?.dropped > 0);
  }

  // Whether a count has grown lately: one bad frame an hour ago is no news.
  #grows(name, count) {
    const known = this.#counts.get(name);
    const now = performance.now();
    if (known === undefined || count < known.count) this.#counts.set(name, { count, at: -Infinity });
    else if (count > known.count) this.#counts.set(name, { count, at: now });
    return now - this.#counts.get(name).at < NEWS_MS;
  }

  #age() {
    const age = this.#world.age(performance.now());
    const quiet = age > STALE_S && !this.#world.state.paused && !this.#world.watchesRecording;
    fact("age", age === Infinity ? "none" : age < 1 ? `${age.toFixed(1)} s` : `${Math.round(age)} s`, quiet);
    if (this.#closed === null) {
      const words = `No news for ${Math.round(age)} s: what you see is old.`;
      const silent = quiet && age > SILENT_S && age !== Infinity;
      if (silent && !this.#silent) say(this.#said, "No news: what you see is old");
      this.#silent = silent;
      this.#notices.banner("stale", silent ? "No news: what you see is old." : null, { bad: true });
      this.#notices.retell("stale", words);
    }
  }

  // A browser does not say why a websocket was refused; the same address asked for plainly does.
  async #lost(opened) {
    if (this.#closed === null) say(this.#said, "Connection lost");
    this.#closed ??= performance.now();
    this.#notices.banner("stale", null);
    const lost = "No connection to the robot's process; trying again. The base stops by itself when nobody commands it.";
    if (opened) {
      this.#notices.banner("connection", lost, { bad: true });
      return;
    }
    const status = await this.#connection.probe();
    if (this.#connection.open) return;
    if (status === 401 || status === 403) {
      this.#notices.banner("connection", "The token is missing or wrong: open the address that the run printed when it started.", { bad: true });
      say(byId("reason"), "token missing or wrong");
    } else this.#notices.banner("connection", lost, { bad: true });
  }
}

function fact(name, text, bad = false) {
  const element = byId(`fact-${name}`);
  say(element, text);
  element.parentElement.classList.toggle("bad", Boolean(bad));
}
