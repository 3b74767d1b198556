// @ts-check
// The state of the run, assembled from the frames received. Nothing here draws or sends.

import { Emitter } from "./emitter.js";
import { hidingWall } from "./walls.js";

const TRAIL_STEP_M = 0.02;
const TRAIL_MAX = 6000;
const ECHOES_MAX = 480;
const ECHO_AGE_MAX_S = 6;
const CROSS_PATHS_MAX = 192; // a round of a ring's 12 steps with 16 listeners each
const CROSS_PATH_AGE_MAX_S = 1;
const CHART_MAX = 600;

/** @type {Shown} */
const EMPTY = {
  cycle: 0,
  robot_s: 0,
  host_s: 0,
  mode: "no data",
  reason: null,
  hold_reason: null,
  arming: false,
  pose: [0, 0, 0],
  ring_yaw: 0,
  twist: [0, 0],
  flags: [],
  firing: [],
  ranges: [],
  age: [],
  cross_paths: [],
  clusters: [],
  objects: [],
  areas: [],
  canyons: [],
  vectors: [],
  drive_request: null,
  valley: null,
  phases: {},
  cycle_us: 0,
  late_us: 0,
  waiting: 0,
  localized: null,
  missed: null,
  late: null,
  quanta: 0,
  refinement: "",
  link: null,
  sensors: [],
  dropped: 0,
  clients: 0,
  controller: false,
  recording: null,
  paused: false,
  speed: 1,
  playback: null,
};

// A change of these is a change of the mode or of what belongs to it.
const MODE = /** @type {const} */ (["mode", "reason", "hold_reason", "arming", "paused"]);
// What a frame says of the robot itself. While a recording is shown, messages of their own bring it.
const ROBOT = /** @type {const} */ ([
  "mode",
  "reason",
  "hold_reason",
  "arming",
  "clients",
  "recording",
  "paused",
  "speed",
]);

/**
 * @typedef {object} RunEvents
 * @property {[SessionMessage]} session
 * @property {[SampleRow[]]} history
 * @property {[Shown]} state
 * @property {[Robot]} mode
 * @property {[LogMessage]} log
 * @property {[RoleMessage]} role
 * @property {[]} evidence
 */

/** @extends {Emitter<RunEvents>} */
export class RunState extends Emitter {
  /** @type {SessionMessage | null} */
  session = null;
  /** @type {Places | null} */
  places = null; // those on the map, once they are made
  state = EMPTY; // what is shown: the live run, or a moment of a recording
  /** @type {Robot} */
  robot = pick(EMPTY, ROBOT); // the robot as it is now, whatever is shown
  fresh = false; // whether a state has arrived since the session began
  /** @type {number | null} */
  received_ms = null;
  /** @type {ObjectRow[]} */
  archived = []; // objects left behind; a frame lists them when they have changed
  /** @type {PolylineRow[]} */
  polylines = []; // outlines of what is not straight, likewise
  /** @type {WayRow} */
  knownWay = { path: [], maps: [], loops: [] }; // the way as maps of it correct it, likewise
  /** @type {Map<number, Segment>} */
  segments = new Map();
  segmentsVersion = 0;
  /** @type {Array<{ x: number; y: number; t: number }>} */
  trail = [];
  trailVersion = 0;
  /** @type {Array<SensorPose & { range: number; t: number }>} */
  echoes = []; // arcs of recent ones
  /** @type {KeptPath[]} */
  crossPaths = []; // the newest, with the sensors' frames when they listened
  /** @type {Column[]} */
  chart = []; // a column a frame
  /** @type {Evidence | null} */
  evidence = null;
  /** @type {Grid | null} */
  grid = null; // the evidence grid, if its layer asks for it
  /** @type {LogMessage[]} */
  log = [];

  // A greeting may come again, with other parameters or models; the whole map comes after it, the past stays known.
  /** @param {SessionMessage} session */
  beginSession(session) {
    this.session = session;
    this.fresh = false;
    this.segments.clear();
    this.segmentsVersion++;
    this.emit("session", session);
  }

  // What the run was before the page was opened: its trail, and samples for the plots.
  /** @param {HistoryRow} history */
  takeHistory({ trail, samples }) {
    const before = trail.map(([x, y, t]) => ({ x, y, t })),
      last_s = before.at(-1)?.t ?? -Infinity;
    this.trail = [...before, ...this.trail.filter(({ t }) => t > last_s)];
    this.trailVersion++;
    this.emit("history", samples);
  }

  get watchesRecording() {
    return this.state.playback !== null;
  }

  /** @param {string} name */
  model(name) {
    return this.session?.models?.find((model) => model.name === name) ?? null;
  }

  /** @param {number | null} number */
  object(number) {
    return this.state.objects.find((object) => object.number === number) ?? null;
  }

  // Within this of its place lies an object, m; of what has no model not much is known.
  /** @param {{ model: string }} object */
  radius(object) {
    return this.model(object.model)?.arc_radius_m ?? 0.1;
  }

  // The frame of a sensor in the plane, as the ring stands now or stood then: x, y, heading, ring's yaw.
  /** @param {number} index @returns {SensorPose | null} */
  sensor(index, /** @type {Quad} */ [x, y, heading, ringYaw] = [...this.state.pose, this.state.ring_yaw]) {
    const mount = this.session?.ring?.mounts?.[index];
    if (mount === undefined) return null;
    const yaw = this.#turns(index) ? heading : ringYaw;
    const c = Math.cos(yaw),
      s = Math.sin(yaw);
    return { x: x + c * mount[0] - s * mount[1], y: y + s * mount[0] + c * mount[1], angle: yaw + mount[2] };
  }

  // The direction of the part of the ring on which a sensor is: some turn with the wheels of a synchro drive.
  /** @param {number} index */
  yaw(index) {
    return this.#turns(index) ? this.state.pose[2] : this.state.ring_yaw;
  }

  /** @param {number} index */
  #turns(index) {
    return this.session?.ring?.turning?.includes(index);
  }

  /** @param {StateMessage} frame @param {number} now_ms */
  apply(frame, now_ms) {
    const before = this.state;
    this.archived = frame.archived ?? this.archived;
    this.polylines = frame.polylines ?? this.polylines;
    this.knownWay = frame.known_way ?? this.knownWay;
    const shown = { ...EMPTY, ...frame };
    const objects = [...shown.objects, ...this.archived]
      .sort((a, b) => (a.number ?? Infinity) - (b.number ?? Infinity)) // frames list them by score, which changes
      .map((object) => ({ ...object, hidden_by: /** @type {number | null} */ (null) }));
    for (const object of objects)
      object.hidden_by = hidingWall({ ...shown, objects }, object, this.radius(object))?.number ?? null;
    const state = { ...shown, objects };
    const jumped = state.robot_s < before.robot_s - 1e-9 || (state.playback === null) !== (before.playback === null);
    const switched =
      !this.fresh || state.controller !== before.controller || (state.playback === null) !== (before.playback === null);
    this.state = state;
    if (jumped) this.#forgetTime();
    this.#applySegments(frame.segments);
    this.#applyTrail(state);
    this.#applyEchoes(state);
    this.#applyCrossPaths(state);
    if (state.playback === null) this.#applyChart(state, before, this.fresh && !jumped);
    this.fresh = true;
    const changed = state.playback === null && this.#takeRobot(frame, now_ms);
    this.emit("state", state);
    if (changed || switched) this.emit("mode", this.robot);
  }

  // The robot's own state, while the frames show a recording.
  /** @param {RobotMessage} status @param {number} now_ms */
  applyRobot(status, now_ms) {
    const changed = this.#takeRobot(status, now_ms);
    this.emit("state", this.state);
    if (changed) this.emit("mode", this.robot);
  }

  // Returns whether the mode or what belongs to it has changed.
  /** @param {StateMessage | RobotMessage} status @param {number} now_ms */
  #takeRobot(status, now_ms) {
    const before = this.robot;
    this.robot = pick({ ...EMPTY, ...status }, ROBOT);
    this.received_ms = now_ms;
    return MODE.some((key) => this.robot[key] !== before[key]);
  }

  #forgetTime() {
    this.trail = [];
    this.trailVersion++;
    this.echoes = [];
    this.crossPaths = [];
    this.chart = [];
    this.grid = null;
  }

  /** @param {SegmentRows} update */
  #applySegments(update) {
    if (!update) return;
    if (update.whole) this.segments.clear();
    for (const number of update.removed ?? []) this.segments.delete(number);
    for (const [number, x1, y1, x2, y2, normal, t] of update.added ?? []) {
      this.segments.set(number, { number, x1, y1, x2, y2, normal, t, pinned: false });
    }
    const pinned = new Set(update.pinned ?? []);
    let repinned = false;
    for (const segment of this.segments.values()) {
      const now = pinned.has(segment.number);
      repinned ||= now !== segment.pinned;
      segment.pinned = now;
    }
    if (update.whole || repinned || update.added?.length || update.removed?.length) this.segmentsVersion++;
  }

  /** @param {Shown} state */
  #applyTrail({ pose: [x, y], robot_s: t }) {
    const last = this.trail.at(-1);
    if (last && Math.hypot(x - last.x, y - last.y) < TRAIL_STEP_M) return;
    if (last && Math.hypot(x - last.x, y - last.y) > 1) this.trail = []; // odometry restarted
    this.trail.push({ x, y, t });
    if (this.trail.length > TRAIL_MAX) this.trail.splice(0, TRAIL_MAX / 4);
    this.trailVersion++;
  }

  /** @param {Shown} state */
  #applyEchoes({ firing, ranges, robot_s: t }) {
    for (const index of firing) {
      const range = ranges[index];
      const at = this.sensor(index);
      if (at !== null && range !== null && range !== undefined && range >= 0) this.echoes.push({ ...at, range, t });
    }
    let old = Math.max(0, this.echoes.length - ECHOES_MAX);
    while (old < this.echoes.length && t - this.echoes[old].t > ECHO_AGE_MAX_S) old++;
    if (old > 0) this.echoes.splice(0, old);
  }

  /** @param {Shown} state */
  #applyCrossPaths({ cross_paths: firings, robot_s: now_s }) {
    const newest = this.crossPaths.at(-1)?.t ?? -Infinity;
    for (const { robot_s: t, pose, paths } of firings.filter((firing) => firing.robot_s > newest)) {
      for (const [from, to, half] of paths) {
        const transmitter = this.sensor(from, pose),
          listener = this.sensor(to, pose);
        if (transmitter !== null && listener !== null) this.crossPaths.push({ transmitter, listener, half, t });
      }
    }
    this.crossPaths = this.crossPaths.slice(-CROSS_PATHS_MAX).filter(({ t }) => now_s - t <= CROSS_PATH_AGE_MAX_S);
  }

  /** @param {Shown} state @param {Shown} before @param {boolean} follows */
  #applyChart({ phases, late_us, missed, late, cycle }, before, follows) {
    if (follows && cycle === before.cycle) return;
    this.chart.push({
      phases,
      late_ms: (late_us ?? 0) / 1000,
      missed: follows ? (missed ?? 0) - (before.missed ?? 0) : 0,
      late: follows ? (late ?? 0) - (before.late ?? 0) : 0,
    });
    if (this.chart.length > CHART_MAX) this.chart.splice(0, this.chart.length - CHART_MAX);
  }

  /** @param {LogMessage} entry */
  note(entry) {
    this.log.push(entry);
    if (this.log.length > 1000) this.log.splice(0, 200);
    this.emit("log", entry);
  }

  // How long ago the robot's process last reported its state, by the page's clock, s.
  /** @param {number} now_ms */
  age(now_ms) {
    return this.received_ms === null ? Infinity : (now_ms - this.received_ms) / 1000;
  }
}

/** @template {object} T @template {keyof T} K @param {T} from @param {readonly K[]} keys @returns {Pick<T, K>} */
function pick(from, keys) {
  return /** @type {Pick<T, K>} */ (Object.fromEntries(keys.map((key) => [key, from[key]])));
}
