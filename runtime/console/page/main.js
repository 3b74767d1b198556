// @ts-check
// The operator console: creates the modules and connects them.

import { byId, el, setAttribute, setText } from "./dom.js";
import { Alerts } from "./alerts.js";
import { Beside } from "./beside.js";
import { Buttons } from "./buttons.js";
import { Charts } from "./charts.js";
import { Connection } from "./connection.js";
import { Drive } from "./drive.js";
import { watchGrid } from "./draw_evidence.js";
import { DriveMode } from "./drive_mode.js";
import { Files } from "./files.js";
import { watchKeyboard } from "./keyboard.js";
import { listLayers, makeLayers } from "./layers.js";
import { Log } from "./log.js";
import { MapEdits } from "./map_edits.js";
import { MapFile } from "./map_file.js";
import { MissionPanel } from "./mission.js";
import { Notifications } from "./notifications.js";
import { describeMap, Objects } from "./objects.js";
import { Parameters } from "./parameters.js";
import { Places } from "./places.js";
import { PlacesPanel } from "./places_panel.js";
import { Plots } from "./plots.js";
import { watchPointers } from "./pointer.js";
import { prefer, preferred } from "./preferences.js";
import { Ring } from "./ring.js";
import { RobotForm } from "./robot_form.js";
import { Robots } from "./robots.js";
import { Scene } from "./scene.js";
import { Selection } from "./selection.js";
import { SettingsFiles } from "./settings_files.js";
import { watchSplitters } from "./splitters.js";
import { Status } from "./status.js";
import { Tabs } from "./tabs.js";
import { Teleoperation } from "./teleoperation.js";
import { Theme } from "./theme.js";
import { screenshot, Time } from "./time.js";
import { askForToken, takeToken } from "./token.js";
import { hereTool, moveTool, placeTool } from "./tool_objects.js";
import { Route } from "./route.js";
import { RoutePanel } from "./route_panel.js";
import { placesTool } from "./tool_places.js";
import { goalTool, tapeTool } from "./tool_points.js";
import { routeTool } from "./tool_route.js";
import { selectionBar, panTool, selectTool } from "./tool_select.js";
import { Toolbox } from "./tools.js";
import { Tour } from "./tour.js";
import { Units } from "./units.js";
import { extent, View } from "./view.js";
import { RunState } from "./run_state.js";

const DESCRIPTION_EVERY_MS = 5000;
const ROOM_M = 0.6;

const token = takeToken();
const query = token === "" ? "" : `?token=${encodeURIComponent(token)}`;
const connection = new Connection(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws${query}`);
const run = new RunState(),
  view = new View(),
  units = new Units(),
  notifications = new Notifications();
connection.showsRecording = () => run.watchesRecording;
connection.isPaused = () => run.robot.paused;
const selection = new Selection(run);
const options = { ellipseScale: preferred("ellipse scale", 10) };
const front = byId("map-front");
const layers = makeLayers();

/** @type {Scene | null} */
let scene = null;
const redraw = () => scene?.invalidate("front");
const redrawAll = () => scene?.invalidate("back", "front");
const theme = new Theme(() => {
  redrawAll();
  drawInstruments();
});

const panels = { run, units, connection, notifications };
const tokenField = () => askForToken(notifications);

const mapEdits = new MapEdits(panels);
const route = new Route({ run, connection, notifications });
const places = new Places({ run, connection, notifications });
const places_tool = placesTool({ places, view, redraw });
/** @param {string} text */
const announce = (text) => setText(byId("announce"), text);
const tools = new Toolbox({
  box: byId("tools"),
  canvas: front,
  view,
  redraw,
  tools: [
    panTool(view),
    selectTool({ run, view, selection, redraw }),
    moveTool({ run, view, selection, mapEdits, redraw }),
    placeTool({ run, view, connection, notifications, redraw }),
    goalTool({
      sendGoal: (x, y, heading) =>
        drive
          .goal(x, y, heading)
          .then(() => notifications.toast(`Goal: ${units.place(x, y)}`), notifications.showError),
      after: () => tools.choose("pan"),
      redraw,
    }),
    tapeTool({ units, announce, redraw }),
    hereTool({ run, connection, notifications, redraw, choose: (id) => tools.choose(id) }),
    routeTool({ route, view, redraw }),
    places_tool,
  ],
});
scene = new Scene({
  back: byId("map-back"),
  front,
  layers,
  overlay: (f) => tools.draw(f),
  run,
  view,
  theme,
  units,
  selection,
  options,
});
watchPointers(front, view, () => tools.current);

const teleoperation = new Teleoperation({ connection, run });
const drive = new Drive({ ...panels, teleoperation, tools, askForToken: tokenField });
new MissionPanel(panels);
new RoutePanel({ ...panels, route, tools });
route.on("changed", redraw);
new PlacesPanel({ ...panels, places, tool: places_tool, tools });
places.on("changed", redraw);
const alerts = new Alerts({ run, connection, seen: () => byId("log").offsetParent !== null });
new Status({ ...panels, alerts, askForToken: tokenField });
new Objects({ ...panels, selection, tools });
const parameters = new Parameters(panels);
const log = new Log(run);
const time = new Time({ ...panels, shoot: () => scene && screenshot({ scene, view, run, theme, units }) });
const ring = new Ring({ run, theme, units });
const charts = new Charts({ run, theme });
const tabs = new Tabs((name) => {
  prefer("tab", name);
  panelShown(name);
});
const plots = new Plots({ run, units, theme, shown: () => tabs.shows("plot") });
const chosen = selectionBar({ run, selection, connection, notifications });
/** @param {string} path @param {Record<string, string>} given */
const address = (path, given) => `${path}?${new URLSearchParams(token === "" ? given : { ...given, token })}`;
const files = new Files({
  ...panels,
  address,
  play: async (file) => {
    if (await time.openFile(file)) tabs.show("time");
  },
  showFiles: () => tabs.show("files"),
});
new SettingsFiles(panels);
new RobotForm(panels);
new Robots({ run, connection });
new MapFile({ ...panels, tools });
/** @param {string} name */
const panelShown = (name) => {
  drawInstruments();
  alerts.look();
  if (name === "time") time.shown();
  if (name === "files") files.shown();
};
const buttons = new Buttons({ run, notifications });
buttons.offer("mission", () =>
  (run.session?.missions ?? []).map(({ name }) => ({
    id: name,
    name,
    did: "Mission started",
    act: () => connection.request({ type: "start_mission", name }),
  })),
);
buttons.offer("place", () =>
  places.all.place.map(({ name }) => ({
    id: name,
    name,
    did: "Goal",
    act: () => connection.request({ type: "go_to_place", name }),
  })),
);

let instrumentsAsked = false;
function drawInstruments() {
  if (instrumentsAsked) return;
  instrumentsAsked = true;
  requestAnimationFrame(() => {
    instrumentsAsked = false;
    ring.draw();
    charts.draw();
    plots.draw();
  });
}
const instrumentsResized = new ResizeObserver(() => drawInstruments());
for (const id of ["panel-cycle", "plot-lanes"]) instrumentsResized.observe(byId(id));
watchSplitters();

// Measure what covers the map, so that fitting keeps clear of it: a row takes height, a column width.
function measureInsets() {
  const map = byId("map").getBoundingClientRect();
  const insets = { left: 20, right: 20, top: 20, bottom: 34 };
  for (const box of [byId("tools"), byId("view-buttons")].map((one) => one.getBoundingClientRect())) {
    if (box.width > box.height) {
      if (box.top - map.top < map.bottom - box.bottom) insets.top = Math.max(insets.top, box.bottom - map.top + 10);
      else insets.bottom = Math.max(insets.bottom, map.bottom - box.top + 10);
    } else if (box.left - map.left < map.right - box.right)
      insets.left = Math.max(insets.left, box.right - map.left + 16);
    else insets.right = Math.max(insets.right, map.right - box.left + 16);
  }
  view.insets = insets;
}
new ResizeObserver(() => {
  measureInsets();
  if (!view.touched && run.fresh) fitUntouched();
}).observe(byId("map"));

// The view.
const fit = () => view.fit(extent(run));
for (const [id, act] of Object.entries({
  "zoom-in": () => view.zoom(1.25),
  "zoom-out": () => view.zoom(0.8),
  fit,
  follow: () => view.setFollow(!view.follow),
  units: () => units.choose(units.name === "m" ? "ft" : "m"),
}))
  byId(id).addEventListener("click", act);
view.on("changed", redrawAll);
view.on("follow", (on) => {
  setAttribute(byId("follow"), "aria-pressed", on);
  if (on) view.followTo(run.state.pose[0], run.state.pose[1]);
});
const unitsGiven = preferred("units", "");
units.on("changed", () => {
  setText(byId("units"), units.name);
  setAttribute(byId("units"), "aria-label", `Units: ${units.word}`);
  redrawAll();
  drawInstruments();
});
byId("units").addEventListener("click", () => prefer("units", units.name));
byId("ellipse-scale").value = String(options.ellipseScale);
byId("ellipse-scale").addEventListener("change", () => {
  options.ellipseScale = Number(byId("ellipse-scale").value);
  prefer("ellipse scale", options.ellipseScale);
  redraw();
});
listLayers(byId("layers"), layers, redrawAll);
selection.on("segments", redrawAll);
selection.on("object", redraw);
run.on("evidence", redraw);

// Messages from the robot.
run.on("session", (session) => {
  units.choose(unitsGiven || (session.units ?? "m"));
  redrawAll();
});
let fitted = false;
let drawnVersion = -1,
  drawnSecond = -1,
  described_ms = -Infinity;
run.on("state", (state) => {
  const now = performance.now();
  if (!view.touched && !(fitted && view.shows(extent(run)))) fitUntouched(fitted ? ROOM_M : 0);
  view.followTo(state.pose[0], state.pose[1]);
  const second = Math.floor(state.robot_s);
  if (run.segmentsVersion !== drawnVersion || second !== drawnSecond) {
    [drawnVersion, drawnSecond] = [run.segmentsVersion, second];
    scene?.invalidate("back");
  }
  redraw();
  drawInstruments();
  if (now - described_ms > DESCRIPTION_EVERY_MS) {
    described_ms = now;
    setText(byId("map-text"), describeMap(run, units));
  }
});
// Keep everything in view until the operator moves the map; leave a margin once the content has outgrown the view.
function fitUntouched(room = 0) {
  const { left, right, bottom, top } = extent(run);
  view.fit({ left: left - room, right: right + room, bottom: bottom - room, top: top + room });
  view.touched = false;
  fitted = true;
}

watchGrid({
  layer: layers.find(({ id }) => id === "evidence_grid") ?? layers[0],
  run,
  connection,
  notifications,
  changed: () => scene?.invalidate("back"),
});
connection.on("session", ({ history: past = null, ...session }) => {
  run.beginSession(session);
  if (past !== null) run.takeHistory(past);
});
connection.on("state", (state) => run.apply(state, performance.now()));
connection.on("robot", (status) => run.applyRobot(status, performance.now()));
connection.on("log", (entry) => run.note(entry));
connection.on("role", (message) => run.emit("role", message));
connection.on("parameters", (message) => parameters.show(message.parameters));
connection.on("refused", (refusal) => notifications.toast(refusal.message));

byId("clear-map").addEventListener("click", () =>
  notifications.confirm(
    "Clear the map?",
    el(
      "p",
      {},
      "All segments, clusters and objects are deleted; recognition starts again. ",
      "Undo brings segments, objects and walls back, and vacant areas stay.",
    ),
    [
      ["Keep it", null],
      ["Clear the map", () => void connection.request({ type: "clear_map" }).catch(notifications.showError)],
    ],
  ),
);
watchKeyboard({
  drive,
  tools,
  view,
  fit,
  chosen,
  time,
  undo: () =>
    (tools.current.id === "route"
      ? route
      : tools.current.id === "places"
        ? places_tool
        : tabs.shown === "tune"
          ? parameters
          : tabs.shown === "files"
            ? files
            : tabs.shown === "time"
              ? time
              : mapEdits
    ).undo(),
  notifications,
  drivingByKeys: () => byId("teleop-keys").checked,
});
// What a panel lists when it is shown is asked for again once there is a run to answer: a reload shows it before that.
connection.on("open", () => {
  for (const name of [tabs.shown, tabs.beside]) panelShown(name);
});
connection.connect();
tabs.restore(preferred("tab", ""));
new Beside({ tabs, shown: panelShown });
tools.restore(preferred("tool", ""));
new DriveMode({ teleoperation, changed: () => drawInstruments() });
const tour = new Tour({ mayAct: () => run.session?.has_token ?? token !== "" });
run.on("session", () => tour.refresh());
tour.beginOnce();

export { buttons, connection, teleoperation, log, scene, selection, tabs, tools, units, view, run };
