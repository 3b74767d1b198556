// Made from the message models and the page's HTML by `python -m tests.page_types`.

/** What a run sends, by its type. */
interface Messages {
  state: StateMessage;
  places: PlacesMessage;
  session: SessionMessage;
  challenge: ChallengeMessage;
  robot: RobotMessage;
  parameters: ParametersMessage;
  robots: RobotsMessage;
  role: RoleMessage;
  log: LogMessage;
  answer: AnswerMessage;
  grid: GridMessage;
  job: JobMessage;
  opening: OpeningMessage;
  replay_problem: ReplayProblemMessage;
}

/** The arguments of each command. */
interface Commands {
  halt: { };
  arm: { };
  disarm: { };
  take_control: { };
  release_control: { };
  grant_control: { client: number; };
  legs: { };
  goal: { x: number; y: number; heading?: number | null; frame?: "odom" | "map"; };
  start_mission: { name: string; };
  run_mission: { toml: string; };
  read_mission: { toml: string; };
  set_route: { waypoints: Array<[number, number, number | null]>; frame: "odom" | "map"; };
  save_route: { name: string; waypoints: Array<[number, number, number | null]>; frame: "odom" | "map"; };
  hold_mission: { };
  resume_mission: { };
  skip_step: { };
  teleoperate: { v: number; w: number; };
  clear_map: { };
  delete_segments: { numbers: Array<number>; };
  pin_segments: { numbers: Array<number>; pinned: boolean; };
  place_model: { model: string; x: number; y: number; theta: number; };
  move_object: { object: number; x: number; y: number; theta: number; };
  reject_object: { object: number; };
  lift_area: { area: number; };
  undo_edit: { };
  set_places: { places: PlacesConfig; };
  undo_places: { };
  go_to_place: { name: string; };
  read_places: { text: string; };
  save_map: { format: "toml" | "geojson"; };
  place_robot: { x: number; y: number; theta: number; };
  confirm_object: { object: number; };
  evidence: { object: number; };
  show_grid: { };
  load_model: { toml: string; };
  robot_file: {
    name: string;
    driver: string;
    count: number | null;
    radius_m: number | null;
    sensors: Array<[number, number, number]> | null;
    beam_half_angle_deg: number;
    resolution_m: number;
    range_min_m: number;
    range_max_m: number;
    preset: string;
    step_period_s: number;
    body_radius_m: number;
    speed_max_m_s: number;
    turn_max_rad_s: number;
    synchro: boolean;
  };
  load_map: { toml: string | null; };
  set_parameter: { path: string; value: boolean | number | string | null; };
  undo_parameter: { };
  list_settings: { };
  read_settings: { file: number; };
  check_settings: { file: number; toml: string; };
  change_settings: { file: number; toml: string; path: string; value: boolean | number | string | null; };
  save_settings: { file: number; toml: string; digest: string; };
  restart_run: { };
  save_toml: { };
  pause: { };
  resume: { };
  single_step: { };
  set_speed: { factor: number; };
  record: { on: boolean; };
  bookmark: { text: string; };
  undo_bookmark: { };
  list_recordings: { };
  open_recording: { file: string; };
  seek_recording: { s: number; };
  play_recording: { speed: number; };
  step_recording: { cycles: number; };
  close_recording: { };
  rename_recording: { file: string; to: string; };
  pin_recording: { file: string; pinned: boolean; };
  undo_file: { };
  delete_recording: { file: string; };
  make_files: { kind: "report" | "map"; file: string; };
  list_jobs: { };
  cancel_job: { job: number; };
}

/** The data of the answer to each command. */
interface Answers {
  halt: null;
  arm: null;
  disarm: null;
  take_control: null;
  release_control: null;
  grant_control: null;
  legs: null;
  goal: null;
  start_mission: null;
  run_mission: null;
  read_mission: MissionAnswer;
  set_route: null;
  save_route: string;
  hold_mission: null;
  resume_mission: null;
  skip_step: null;
  teleoperate: null;
  clear_map: null;
  delete_segments: null;
  pin_segments: null;
  place_model: null;
  move_object: null;
  reject_object: null;
  lift_area: null;
  undo_edit: string;
  set_places: null;
  undo_places: null;
  go_to_place: null;
  read_places: PlacesConfig;
  save_map: string;
  place_robot: null;
  confirm_object: null;
  evidence: EvidenceAnswer;
  show_grid: null;
  load_model: Record<string, string>;
  robot_file: string;
  load_map: null;
  set_parameter: Array<ChangedValue>;
  undo_parameter: ChangedValue | Array<ChangedValue>;
  list_settings: Array<SettingsRow>;
  read_settings: SettingsText;
  check_settings: SettingsCheck;
  change_settings: string;
  save_settings: SettingsText;
  restart_run: null;
  save_toml: string;
  pause: null;
  resume: null;
  single_step: null;
  set_speed: null;
  record: null;
  bookmark: null;
  undo_bookmark: string;
  list_recordings: Array<ListedRecording>;
  open_recording: OpenedRecording;
  seek_recording: null;
  play_recording: null;
  step_recording: null;
  close_recording: null;
  rename_recording: string;
  pin_recording: null;
  undo_file: string;
  delete_recording: null;
  make_files: number;
  list_jobs: Array<JobMessage>;
  cancel_job: null;
}

/** The elements of the pages, by their id. */
interface PageElements {
  "announce": HTMLElement;
  "areas": HTMLElement;
  "areas-count": HTMLElement;
  "areas-part": HTMLElement;
  "arm": HTMLButtonElement;
  "arm-row": HTMLElement;
  "banners": HTMLElement;
  "beside": HTMLElement;
  "beside-close": HTMLButtonElement;
  "beside-name": HTMLElement;
  "beside-panel": HTMLSelectElement;
  "bookmark-form": HTMLFormElement;
  "bookmark-text": HTMLInputElement;
  "bookmark-undo": HTMLButtonElement;
  "bookmarks": HTMLElement;
  "button-action": HTMLSelectElement;
  "button-error": HTMLOutputElement;
  "button-form": HTMLFormElement;
  "button-key": HTMLInputElement;
  "button-list": HTMLElement;
  "buttons-part": HTMLElement;
  "clear-map": HTMLButtonElement;
  "dialog": HTMLDialogElement;
  "dialog-body": HTMLElement;
  "dialog-buttons": HTMLElement;
  "dialog-title": HTMLElement;
  "disarm": HTMLButtonElement;
  "dock": HTMLElement;
  "dock-close": HTMLButtonElement;
  "dock-facts": HTMLElement;
  "dock-halt": HTMLElement;
  "dock-pad": HTMLElement;
  "drive-gains": HTMLElement;
  "drive-mode": HTMLButtonElement;
  "drive-request-goal": HTMLButtonElement;
  "drive-request-legs": HTMLButtonElement;
  "drive-request-text": HTMLElement;
  "ellipse-scale": HTMLSelectElement;
  "evidence": HTMLElement;
  "fact-age": HTMLElement;
  "fact-clients": HTMLElement;
  "fact-dropped": HTMLElement;
  "fact-flags": HTMLElement;
  "fact-late": HTMLElement;
  "fact-link": HTMLElement;
  "fact-place": HTMLElement;
  "fact-recording": HTMLElement;
  "fact-role": HTMLElement;
  "fact-twist": HTMLElement;
  "facts": HTMLElement;
  "file": HTMLElement;
  "file-delete": HTMLButtonElement;
  "file-download": HTMLAnchorElement;
  "file-error": HTMLOutputElement;
  "file-facts": HTMLElement;
  "file-map": HTMLButtonElement;
  "file-name": HTMLElement;
  "file-new-name": HTMLInputElement;
  "file-opening": HTMLElement;
  "file-pin": HTMLButtonElement;
  "file-play": HTMLButtonElement;
  "file-rename": HTMLFormElement;
  "file-rename-do": HTMLButtonElement;
  "file-report": HTMLButtonElement;
  "files": HTMLElement;
  "files-again": HTMLButtonElement;
  "files-count": HTMLElement;
  "files-empty": HTMLElement;
  "files-undo": HTMLButtonElement;
  "fit": HTMLButtonElement;
  "fleet-add": HTMLFormElement;
  "fleet-alarm": HTMLElement;
  "fleet-error": HTMLOutputElement;
  "fleet-none": HTMLElement;
  "fleet-runs": HTMLElement;
  "fleet-summary": HTMLElement;
  "fleet-url": HTMLInputElement;
  "follow": HTMLButtonElement;
  "give-control": HTMLButtonElement;
  "goal-error": HTMLOutputElement;
  "goal-form": HTMLFormElement;
  "goal-heading": HTMLInputElement;
  "goal-unit": HTMLElement;
  "goal-x": HTMLInputElement;
  "goal-y": HTMLInputElement;
  "halt": HTMLButtonElement;
  "halt-all": HTMLButtonElement;
  "here-form": HTMLFormElement;
  "here-heading": HTMLInputElement;
  "here-unit": HTMLElement;
  "here-x": HTMLInputElement;
  "here-y": HTMLInputElement;
  "job": HTMLElement;
  "job-cancel": HTMLButtonElement;
  "job-share": HTMLProgressElement;
  "job-text": HTMLElement;
  "keys": HTMLButtonElement;
  "knob": HTMLElement;
  "late": HTMLCanvasElement;
  "late-legend": HTMLElement;
  "layers": HTMLElement;
  "live": HTMLButtonElement;
  "log": HTMLElement;
  "log-badge": HTMLElement;
  "log-filter": HTMLInputElement;
  "log-level": HTMLSelectElement;
  "log-sound": HTMLInputElement;
  "made": HTMLElement;
  "made-part": HTMLElement;
  "map": HTMLElement;
  "map-back": HTMLCanvasElement;
  "map-error": HTMLOutputElement;
  "map-forget": HTMLButtonElement;
  "map-front": HTMLCanvasElement;
  "map-here": HTMLButtonElement;
  "map-known": HTMLElement;
  "map-load": HTMLInputElement;
  "map-make": HTMLButtonElement;
  "map-text": HTMLElement;
  "mission": HTMLElement;
  "mission-about": HTMLElement;
  "mission-hold": HTMLButtonElement;
  "mission-name": HTMLSelectElement;
  "mission-reason": HTMLElement;
  "mission-resume": HTMLButtonElement;
  "mission-skip": HTMLButtonElement;
  "mission-start": HTMLButtonElement;
  "mission-steps": HTMLElement;
  "mission-title": HTMLElement;
  "mode": HTMLElement;
  "mode-icon": SVGUseElement;
  "mode-name": HTMLElement;
  "mode-robot": HTMLElement;
  "model-error": HTMLOutputElement;
  "model-file": HTMLInputElement;
  "new-beam-half-angle-deg": HTMLInputElement;
  "new-body-radius-m": HTMLInputElement;
  "new-count": HTMLInputElement;
  "new-driver": HTMLSelectElement;
  "new-name": HTMLInputElement;
  "new-preset": HTMLSelectElement;
  "new-radius-m": HTMLInputElement;
  "new-range-max-m": HTMLInputElement;
  "new-range-min-m": HTMLInputElement;
  "new-resolution-m": HTMLInputElement;
  "new-speed-max-m-s": HTMLInputElement;
  "new-step-period-s": HTMLInputElement;
  "new-turn-max-rad-s": HTMLInputElement;
  "object": HTMLElement;
  "object-confirm": HTMLButtonElement;
  "object-facts": HTMLElement;
  "object-move": HTMLButtonElement;
  "object-name": HTMLElement;
  "object-reject": HTMLButtonElement;
  "objects": HTMLElement;
  "objects-count": HTMLElement;
  "objects-empty": HTMLElement;
  "open": HTMLButtonElement;
  "own-buttons": HTMLElement;
  "pad": HTMLElement;
  "panel-cycle": HTMLElement;
  "panel-drive": HTMLElement;
  "panel-files": HTMLElement;
  "panel-layers": HTMLElement;
  "panel-log": HTMLElement;
  "panel-objects": HTMLElement;
  "panel-plot": HTMLElement;
  "panel-time": HTMLElement;
  "panel-tune": HTMLElement;
  "pause": HTMLButtonElement;
  "phases": HTMLCanvasElement;
  "phases-legend": HTMLElement;
  "place": HTMLElement;
  "places": HTMLElement;
  "placing": HTMLElement;
  "placing-model": HTMLSelectElement;
  "play": HTMLButtonElement;
  "play-back": HTMLButtonElement;
  "play-speed": HTMLSelectElement;
  "play-step": HTMLButtonElement;
  "playback": HTMLElement;
  "plot-at": HTMLInputElement;
  "plot-earlier": HTMLButtonElement;
  "plot-fields": HTMLElement;
  "plot-filter": HTMLInputElement;
  "plot-follow": HTMLButtonElement;
  "plot-in": HTMLButtonElement;
  "plot-lanes": HTMLElement;
  "plot-later": HTMLButtonElement;
  "plot-none": HTMLElement;
  "plot-out": HTMLButtonElement;
  "plot-read": HTMLOutputElement;
  "plot-save": HTMLButtonElement;
  "plot-window": HTMLSelectElement;
  "reason": HTMLElement;
  "record": HTMLButtonElement;
  "record-text": HTMLElement;
  "recordings": HTMLSelectElement;
  "recordings-again": HTMLButtonElement;
  "report": HTMLButtonElement;
  "ring": HTMLCanvasElement;
  "ring-text": HTMLElement;
  "robot-add": HTMLButtonElement;
  "robot-each": HTMLInputElement;
  "robot-error": HTMLOutputElement;
  "robot-form": HTMLFormElement;
  "robot-name": HTMLElement;
  "robot-part": HTMLElement;
  "robot-picture": SVGSVGElement;
  "robot-save": HTMLButtonElement;
  "robot-sensors": HTMLElement;
  "robot-sensors-part": HTMLElement;
  "robot-synchro": HTMLInputElement;
  "robot-this": HTMLButtonElement;
  "robots": HTMLElement;
  "robots-count": HTMLElement;
  "robots-part": HTMLElement;
  "role-text": HTMLElement;
  "route-add": HTMLButtonElement;
  "route-clear": HTMLButtonElement;
  "route-drive": HTMLButtonElement;
  "route-error": HTMLOutputElement;
  "route-file": HTMLInputElement;
  "route-form": HTMLFormElement;
  "route-form-number": HTMLElement;
  "route-heading": HTMLInputElement;
  "route-keep": HTMLButtonElement;
  "route-list": HTMLElement;
  "route-name": HTMLInputElement;
  "route-save": HTMLFormElement;
  "route-text": HTMLElement;
  "route-undo": HTMLButtonElement;
  "route-unit": HTMLElement;
  "route-x": HTMLInputElement;
  "route-y": HTMLInputElement;
  "screenshot": HTMLButtonElement;
  "scrub": HTMLInputElement;
  "scrub-value": HTMLOutputElement;
  "selection-bar": HTMLElement;
  "selection-count": HTMLElement;
  "selection-delete": HTMLButtonElement;
  "selection-none": HTMLButtonElement;
  "selection-pin": HTMLButtonElement;
  "selection-unpin": HTMLButtonElement;
  "settings": HTMLDialogElement;
  "settings-close": HTMLButtonElement;
  "settings-copy": HTMLButtonElement;
  "settings-difference": HTMLElement;
  "settings-file": HTMLSelectElement;
  "settings-form": HTMLElement;
  "settings-lines": HTMLElement;
  "settings-open": HTMLButtonElement;
  "settings-problems": HTMLElement;
  "settings-restart": HTMLButtonElement;
  "settings-save": HTMLButtonElement;
  "settings-state": HTMLOutputElement;
  "settings-text": HTMLTextAreaElement;
  "settings-title": HTMLElement;
  "single-step": HTMLButtonElement;
  "speed": HTMLSelectElement;
  "split-beside": HTMLElement;
  "split-cycle": HTMLElement;
  "split-map": HTMLElement;
  "split-panel": HTMLElement;
  "tab-cycle": HTMLButtonElement;
  "tab-drive": HTMLButtonElement;
  "tab-files": HTMLButtonElement;
  "tab-layers": HTMLButtonElement;
  "tab-log": HTMLButtonElement;
  "tab-objects": HTMLButtonElement;
  "tab-plot": HTMLButtonElement;
  "tab-time": HTMLButtonElement;
  "tab-tune": HTMLButtonElement;
  "tabs": HTMLElement;
  "take-control": HTMLButtonElement;
  "teleop-facts": HTMLElement;
  "teleop-gamepad": HTMLElement;
  "teleop-keys": HTMLInputElement;
  "teleop-limit": HTMLInputElement;
  "teleop-limit-value": HTMLOutputElement;
  "teleop-state": HTMLElement;
  "time-text": HTMLElement;
  "tip": HTMLElement;
  "toasts": HTMLElement;
  "tools": HTMLElement;
  "tour": HTMLElement;
  "tour-again": HTMLButtonElement;
  "tour-back": HTMLButtonElement;
  "tour-count": HTMLElement;
  "tour-next": HTMLButtonElement;
  "tour-skip": HTMLButtonElement;
  "tour-text": HTMLElement;
  "tour-title": HTMLElement;
  "tune-fields": HTMLElement;
  "tune-filter": HTMLInputElement;
  "tune-save": HTMLButtonElement;
  "tune-undo": HTMLButtonElement;
  "undo-edit": HTMLButtonElement;
  "units": HTMLButtonElement;
  "view-buttons": HTMLElement;
  "zoom-in": HTMLButtonElement;
  "zoom-out": HTMLButtonElement;
}

/** What a mission file holds. */
interface MissionAnswer {
  name: string;
  about: string;
  waypoints: Array<[number, number, number | null]> | null;
  frame: "odom" | "map" | null;
}

/** `[places]`: named places, no-go lines and areas, and speed limits by area. */
interface PlacesConfig {
  place: Array<PlaceConfig>;
  no_go_line: Array<NoGoLineConfig>;
  no_go_area: Array<NoGoAreaConfig>;
  speed_area: Array<SpeedAreaConfig>;
}

/** A named place, to which goals and missions can drive (m, degrees). */
interface PlaceConfig {
  name: string;
  x_m: number;
  y_m: number;
  heading_deg: number | null;
}

/** A line that the robot does not cross. */
interface NoGoLineConfig {
  name: string;
  points_m: Array<[number, number]>;
}

/** An area that the robot does not enter. */
interface NoGoAreaConfig {
  name: string;
  vertices_m: Array<[number, number]>;
}

/** An area in which the robot drives no faster than some speed. */
interface SpeedAreaConfig {
  name: string;
  vertices_m: Array<[number, number]>;
  speed_max_m_s: number;
}

interface EvidenceAnswer {
  object: number;
  model: string;
  for: number;
  against: number;
  readings: Array<[number, number, number | null, number, number]
    | [number, number, number | null, number, number, number, number]>;
  lines: Array<[number, number, number, number, number, boolean]>;
  rivals: Array<[string, number]>;
}

/** A setting that a command has changed. */
interface ChangedValue {
  path: string;
  value: boolean | number | string | null;
}

/** A file in the list. */
interface SettingsRow {
  kind: string;
  name: string;
  shipped: boolean;
}

/** The text of a file. */
interface SettingsText {
  text: string;
  digest: string;
  form: Array<SettingsTable>;
}

/** A table of an installed package in a file, as a form. */
interface SettingsTable {
  title: string;
  help: string;
  fields: Array<Parameter>;
}

/** A setting as the page gets it. */
interface Parameter {
  path: string;
  label: string;
  value: boolean | number | string | null;
  low: number | null;
  high: number | null;
  kind: string;
  choices: Array<string> | null;
  optional: boolean;
  help: string;
}

/** What a changed text would mean. */
interface SettingsCheck {
  problems: Array<ProblemRow>;
  warnings: Array<string>;
  difference: string;
  form: Array<SettingsTable>;
}

/** A problem of a text. */
interface ProblemRow {
  line: number | null;
  text: string;
}

/** A recording that can be opened; what is not known of the one in progress is None. */
interface ListedRecording {
  file: string;
  bytes: number | null;
  modified_s: number | null;
  duration_s: number | null;
  state: "live" | "complete" | "incomplete";
  pinned: boolean;
  live: boolean;
}

/** A recording that a client is shown. */
interface OpenedRecording {
  duration_s: number;
  cycles: number;
  bookmarks: Array<[number, string]>;
  modes: Array<[number, string, string | null]>;
  about: SessionInfo;
  started: string;
  file: string;
}

/** What the settings and the robot say of a session, live or recorded. */
interface SessionInfo {
  type: "session";
  version: string;
  name: string | null;
  emulated: boolean;
  units?: "m" | "ft";
  ring: RingRow;
  body: BodyRow;
  models: Array<ModelRow>;
  radii: Record<string, number>;
  missions: Array<NamedRow>;
  truth: SurfacesRow | null;
  known_room: SurfacesRow | null;
  drivers: Array<string>;
  parameters: Array<Parameter>;
  budget_s: number;
  period_s: number;
}

/** The ring of sensors. */
interface RingRow {
  mounts: Array<[number, number, number]>;
  turning: Array<number>;
  half_angle: number;
  range_min: number;
  range_max: number;
}

/** The robot's body. */
interface BodyRow {
  radius: number;
  speed_max: number;
  turn_max: number;
}

/** An object model. */
interface ModelRow {
  name: string;
  vertices: Array<[number, number]>;
  closed: boolean;
  arc_radius_m: number | null;
}

/** A mission that can be started. */
interface NamedRow {
  name: string;
  about: string;
}

/** The surfaces of a world or a known room. */
interface SurfacesRow {
  drums: Array<[number, number, number]>;
  walls: Array<[number, number, number, number]>;
  polygons: Array<Array<[number, number]>>;
}

/** A report or a map that is being made. */
interface JobMessage {
  type: "job";
  job: number;
  kind: "report" | "map";
  file: string;
  share: number;
  what: string;
  made: Array<string>;
  error: string | null;
  over: boolean;
}

/** The state after a cycle, as a client gets it. */
interface StateMessage {
  mode: "CONNECTING" | "READY" | "DRIVE" | "SAFE_STOP" | "FAULT";
  reason: string | null;
  hold_reason: string | null;
  arming: boolean;
  clients: number;
  recording: RecordingRow | null;
  paused: boolean;
  speed: number;
  type: "state";
  cycle: number;
  robot_s: number;
  host_s: number;
  pose: [number, number, number];
  ring_yaw: number;
  twist: [number, number];
  flags: Array<string>;
  firing: Array<number>;
  ranges: Array<number | null>;
  age: Array<number | null>;
  cross_paths: Array<CrossPathRow>;
  clusters: Array<ClusterBox>;
  objects: Array<ObjectRow>;
  areas: Array<[number, number, number, number]>;
  canyons: Array<CanyonRow>;
  vectors: Array<[string, number, number]>;
  drive_request: GoalRow | TeleoperateRow | LegsRow | MissionRow;
  valley: ValleyRow | null;
  phases: Record<string, number>;
  cycle_us: number | null;
  late_us: number | null;
  missed: number | null;
  late: number | null;
  quanta: number;
  refinement: "budget" | "quota" | "converged" | "nothing";
  link: LinkRow | null;
  waiting: number;
  localized: LocalizedRow | null;
  sensors: Array<[number, "failing" | "stuck" | "too_near" | "silent" | "at_maximum" | "crosstalk", string]>;
  playback: PlaybackRow | null;
  segments: SegmentRows;
  archived?: Array<ObjectRow>;
  polylines?: Array<PolylineRow>;
  known_way?: WayRow;
  dropped: number;
  controller: boolean;
}

/** The recording in progress. */
interface RecordingRow {
  file: string | null;
  bytes: number;
  dropped: number;
}

/** What the listeners of one firing heard. */
interface CrossPathRow {
  robot_s: number;
  pose: [number, number, number, number];
  paths: Array<[number, number, number]>;
}

/** A cluster and the rectangle around it, m, in the odometry frame. */
type ClusterBox = [
  x: number,
  y: number,
  length: number,
  width: number,
  angle: number,
  segments: number,
  centre_x: number,
  centre_y: number,
];

/** An object in odometry's frame. */
interface ObjectRow {
  number: number | null;
  model: string;
  x: number;
  y: number;
  theta: number;
  sigma: number;
  sigma_theta: number | null;
  covariance: [number, number, number] | null;
  probability: number | null;
  support: number;
  score: number;
  confirmed: boolean;
  placed: boolean;
  ends: [number, number, number, number] | null;
}

/** A dead end. */
interface CanyonRow {
  number: number;
  mouth: [number, number, number, number];
  axis: number;
  depth: number;
  probability: number;
}

/** A goal that is driven to. */
interface GoalRow {
  kind: "goal";
  x: number;
  y: number;
  heading: number | null;
  frame: "odom" | "map";
  at: [number, number] | null;
  reached: boolean;
}

/** A velocity of an operator. */
interface TeleoperateRow {
  kind: "teleoperate";
  v: number;
  w: number;
}

/** The configured legs. */
interface LegsRow {
  kind: "legs";
}

/** The mission under way. */
interface MissionRow {
  kind: "mission";
  name: string;
  about: string;
  status: "running" | "held" | "done" | "failed";
  reason: string | null;
  step: number;
  step_s: number;
  way_m: number;
  steps: Array<StepRow>;
}

/** A step of a mission. */
interface StepRow {
  name: string;
  schemas: Array<string>;
  until: Array<[string, string]>;
  places: Array<[number, number, number | null]>;
  place: string | null;
  frame: "odom" | "map";
}

/** The way to a goal. */
interface ValleyRow {
  blocked: string;
  direction: number | null;
  way: Array<[number, number]>;
}

/** Counts of the line. */
interface LinkRow {
  frames: number;
  bad: number;
  lost: number;
}

/** The robot in the map frame. */
interface LocalizedRow {
  pose: [number, number, number];
  covariance: [number, number, number, number] | null;
  status: "tracking" | "localizing" | "lost";
  probability: number;
  frame: [number, number, number];
}

/** The position in the recording that is shown. */
interface PlaybackRow {
  s: number;
  is_playing: boolean;
  speed: number;
}

/** Changes of the outline segments, or all of them. */
interface SegmentRows {
  added: Array<[number, number, number, number, number, number, number | null]>;
  removed: Array<number>;
  pinned: Array<number>;
  whole: boolean;
}

/** An outline of what is not straight, in odometry's frame. */
interface PolylineRow {
  number: number;
  points: Array<[number, number]>;
  probability: number;
}

/** The way as it is known now by maps of a few metres of it, in the map frame; empty where none corrects it. */
interface WayRow {
  path: Array<[number, number]>;
  maps: Array<[number, number, number, number, number]>;
  loops: Array<[number, number, number, number]>;
}

/** The places on the map. */
interface PlacesMessage {
  type: "places";
  frame: "odom" | "map";
  place: Array<PlaceConfig>;
  no_go_line: Array<NoGoLineConfig>;
  no_go_area: Array<NoGoAreaConfig>;
  speed_area: Array<SpeedAreaConfig>;
}

/** The first message, and again when the robot or its models change. */
interface SessionMessage {
  type: "session";
  version: string;
  name: string | null;
  emulated: boolean;
  units?: "m" | "ft";
  ring: RingRow;
  body: BodyRow;
  models: Array<ModelRow>;
  radii: Record<string, number>;
  missions: Array<NamedRow>;
  truth: SurfacesRow | null;
  known_room: SurfacesRow | null;
  drivers: Array<string>;
  parameters: Array<Parameter>;
  budget_s: number;
  period_s: number;
  role: "control" | "watch";
  client: number;
  has_token: boolean;
  robots: Array<RobotRow>;
  places: PlacesMessage;
  history?: HistoryRow;
}

/** Another run on this machine or the local network; what it says is not trusted. */
interface RobotRow {
  name: string;
  mode: string;
  url: string;
  version: string;
}

/** What a page that joins is sent of the time before. */
interface HistoryRow {
  samples: Array<SampleRow>;
  trail: Array<[number, number, number]>;
}

/** The numbers of a past moment, named as those of a state. */
interface SampleRow {
  robot_s: number;
  pose: [number, number, number];
  ring_yaw: number;
  twist: [number, number];
  ranges: Array<number | null>;
  phases: Record<string, number>;
  cycle_us: number;
}

/** The number that commands carry. */
interface ChallengeMessage {
  type: "challenge";
  number: number;
}

/** The robot itself, for a client that watches a recording. */
interface RobotMessage {
  mode: "CONNECTING" | "READY" | "DRIVE" | "SAFE_STOP" | "FAULT";
  reason: string | null;
  hold_reason: string | null;
  arming: boolean;
  clients: number;
  recording: RecordingRow | null;
  paused: boolean;
  speed: number;
  type: "robot";
}

/** A setting was changed. */
interface ParametersMessage {
  type: "parameters";
  parameters: Array<Parameter>;
}

/** Other robots have changed. */
interface RobotsMessage {
  type: "robots";
  robots: Array<RobotRow>;
}

/** Control has changed hands, or a client asks for it. */
interface RoleMessage {
  type: "role";
  role: "control" | "watch";
  asked_by: string | null;
  client: number | null;
}

/** A line of the log. */
interface LogMessage {
  type: "log";
  timestamp: string;
  level: string;
  event: string;
  fields: Record<string, string>;
}

/** The answer to a command. */
interface AnswerMessage {
  type: "answer";
  id: number | null;
  ok: boolean;
  error: string | null;
  field: string | null;
  data: unknown;
}

/** The evidence grid. */
interface GridMessage {
  type: "grid";
  on: boolean;
  x?: number;
  y?: number;
  cell?: number;
  columns: number;
  rows: number;
  cells: string;
}

/** A recording is being opened for this client. */
interface OpeningMessage {
  type: "opening";
  share: number;
}

/** Something is wrong with the recording that this client plays. */
interface ReplayProblemMessage {
  type: "replay_problem";
  error: string;
}

/** A run as the fleet page shows it. */
interface FleetRow {
  address: string;
  url: string;
  name: string;
  is_local: boolean;
  problem: string;
  mode: string;
  reason: string;
  battery: string;
  place: string;
  halt: "none" | "sent" | "confirmed" | "unconfirmed";
}
