// Types that the page's scripts share. Those of the messages are made: see messages.d.ts.

type RunState = import("../../runtime/console/page/run_state.js").RunState;
type View = import("../../runtime/console/page/view.js").View;
type Units = import("../../runtime/console/page/units.js").Units;
type Scene = import("../../runtime/console/page/scene.js").Scene;
type Theme = import("../../runtime/console/page/theme.js").Theme;
type Connection = import("../../runtime/console/page/connection.js").Connection;
type RequestError = import("../../runtime/console/page/connection.js").RequestError;
type Notifications = import("../../runtime/console/page/notifications.js").Notifications;
type Picked = import("../../runtime/console/page/selection.js").Selection;
type Toolbox = import("../../runtime/console/page/tools.js").Toolbox;
type MapEdits = import("../../runtime/console/page/map_edits.js").MapEdits;
type Route = import("../../runtime/console/page/route.js").Route;
type Places = import("../../runtime/console/page/places.js").Places;
type PlacesTool = ReturnType<typeof import("../../runtime/console/page/tool_places.js").placesTool>;
type Teleoperation = import("../../runtime/console/page/teleoperation.js").Teleoperation;
type Alerts = import("../../runtime/console/page/alerts.js").Alerts;
type Tabs = import("../../runtime/console/page/tabs.js").Tabs;

/** The modules that others are made with; each takes what it needs of them. */
interface Parts {
  run: RunState;
  view: View;
  units: Units;
  theme: Theme;
  connection: Connection;
  notifications: Notifications;
  selection: Picked;
  tools: Toolbox;
  mapEdits: MapEdits;
  route: Route;
  places: Places;
  teleoperation: Teleoperation;
  alerts: Alerts;
  tabs: Tabs;
  redraw: () => void;
  askForToken: () => void;
}
/** What a panel is made with. */
type Panels = Pick<Parts, "run" | "units" | "connection" | "notifications">;

/** The element of an id: one of the HTML files, or of a name that is put together. */
type ElementOf<K extends string> = K extends keyof PageElements
  ? PageElements[K]
  : {} extends Record<K, 1>
    ? HTMLElement
    : never;

/** Attributes and listeners of an element that is made. */
interface Properties {
  [name: string]: string | number | boolean | null | undefined | ((event: never) => unknown);
  onclick?: ((event: MouseEvent) => unknown) | null;
  onchange?: (event: Event) => unknown;
}

/** A command with its arguments. */
type Ask<K extends keyof Commands> = { type: K } & Commands[K];

type Mode = StateMessage["mode"];
type Localized = StateMessage["localized"];
type Frame = "odom" | "map";
type Pair = [number, number];
type Triple = [number, number, number];
type Quad = [number, number, number, number];
type Spacing = { left: number; right: number; top: number; bottom: number };

/** The robot itself, whatever is shown. */
type Robot = Omit<RobotMessage, "type" | "mode"> & { mode: Mode | "no data" };

/** An object, and the wall that hides it. */
type ShownObject = ObjectRow & { hidden_by: number | null };

/** What is shown: a state, or nothing yet. */
type Shown = Omit<
  StateMessage,
  "type" | "mode" | "drive_request" | "refinement" | "objects" | "segments" | "archived" | "polylines" | "known_way"
> & {
  mode: Mode | "no data";
  drive_request: StateMessage["drive_request"] | null;
  refinement: StateMessage["refinement"] | "";
  objects: ShownObject[];
};

interface Segment {
  number: number;
  x1: number;
  y1: number;
  x2: number;
  y2: number;
  normal: number;
  t: number | null;
  pinned: boolean;
}

/** A place, and a direction or none. */
type Point = { x: number; y: number };
type Pose = { x: number; y: number; theta: number };
/** The frame of a sensor in the plane. */
type SensorPose = { x: number; y: number; angle: number };
type CrossPath = { transmitter: SensorPose; listener: { x: number; y: number; angle: number | null }; half: number };

/** The evidence for an object that is shown. */
interface Evidence {
  object: number;
  pro: number;
  contra: number;
  readings: Array<{ x: number; y: number; range: number | null; angle: number; nats: number; listener: number[] }>;
  lines: Array<{ number: number; x1: number; y1: number; x2: number; y2: number; supports: boolean }>;
  rivals: Array<[string, number]>;
}

/** A column of the strip charts. */
interface Column {
  phases: Record<string, number>;
  late_ms: number;
  missed: number;
  late: number;
}

/** What the layers and tools draw with. */
interface Drawing extends Pick<Parts, "run" | "view" | "theme" | "units" | "selection"> {
  options: { ellipseScale: number };
  ctx: CanvasRenderingContext2D;
  /** A pixel, in metres. */
  px: number;
  /** Boxes taken by labels: left, top, right, bottom. */
  labels: Quad[];
  inWorld(): void;
  onScreen(): void;
}

interface Layer {
  id: string;
  plane: "back" | "front";
  name: string;
  draw: (f: Drawing) => void;
  shape: string;
  colour: string;
  dash?: string;
  on: boolean;
}

/** A place of the map where a pointer, or the crosshair, is: on the screen and in the plane. */
interface Spot {
  sx: number;
  sy: number;
  x: number;
  y: number;
  shift: boolean;
  touch: boolean;
}

/** A tool on the map; what it lacks, it does not react to. */
interface Tool {
  id: string;
  name: string;
  icon: string;
  /** Whether it sends commands. */
  sends?: boolean;
  begin?(): void;
  end?(): void;
  down?(at: Spot): void;
  move?(at: Spot, was: Spot): void;
  up?(at: Spot): void;
  /** In place of down and up, by the keyboard. */
  press?(at: Spot): void;
  hover?(at: Spot): void;
  leave?(): void;
  cancel?(): void;
  none?(): void;
  key?(event: KeyboardEvent, spot: () => Spot): boolean;
  draw?(f: Drawing): void;
  drawAlways?(f: Drawing): void;
}

/** A button of a banner or a dialog: its label, and what it does. A dialog stays if that returns false. */
type Choice = [string, (() => unknown) | null];

/** The evidence grid, and its picture in the colours that it was painted in. */
type Grid = GridMessage & { picture?: HTMLCanvasElement; theme?: string };

/** What reflected a cross path, and where. */
type Reflector = { object: ShownObject; kind: string; x: number; y: number };
/** A cross path that is kept, with what was worked out of it. */
type KeptPath = CrossPath & { t: number; arc?: Arc | null; reflector?: Reflector | null };
/** The arguments of Path2D.ellipse. */
type Arc = [number, number, number, number, number, number, number];

type PlaceKind = "place" | "no_go_line" | "no_go_area" | "speed_area";
type AreaRow = NoGoLineConfig | NoGoAreaConfig | SpeedAreaConfig;
type PlaceRow = PlaceConfig | AreaRow;
type Waypoint = [number, number, number | null];

/** Elements that scripts make. */
interface PageElements {
  "tool-here": HTMLButtonElement;
  "places-draw": HTMLButtonElement;
  "places-file": HTMLInputElement;
  "places-finish": HTMLButtonElement;
  "places-form": HTMLFormElement;
  "places-error": HTMLElement;
  "places-kind": HTMLSelectElement;
  "places-list": HTMLElement;
  "places-text": HTMLElement;
  "places-undo": HTMLButtonElement;
  "places-name": HTMLInputElement;
  "places-x": HTMLInputElement;
  "places-y": HTMLInputElement;
  "places-heading": HTMLInputElement;
  "places-speed": HTMLInputElement;
}

/** The times that a plot shows, and the present moment. */
type Span = { from: number; to: number; now: number };
/** A time, and the value then, null if it is not known. */
type TimedValue = [number, number | null];
interface PageElements extends Record<`places-${"name" | "x" | "y" | "heading" | "speed"}-field`, HTMLElement> {}
/** What an element holds: nothing, text, or another one. */
type Content = Node | string | null | undefined;

/** A command that waits for its answer. */
interface Pending {
  resolve: (data: unknown) => void;
  refuse: (why: RequestError) => void;
  timer?: number;
  waits: boolean;
}

type Input = HTMLInputElement | HTMLSelectElement;
/** A field that shows a setting; `first` is the value that it had when the page was opened. */
interface Field {
  parameter: Parameter;
  first: Parameter["value"];
  element: HTMLElement;
  input: Input;
  error: HTMLElement;
}

/** A lane of the plots; `second` is the path of its right axis. */
interface Lane extends Record<"element" | "name" | "value", HTMLElement> {
  canvas: HTMLCanvasElement;
  combine: HTMLSelectElement;
  second: string | null;
}

/** What all drawing on the map shares. */
type SceneShared = Omit<Drawing, "ctx" | "px" | "labels" | "inWorld" | "onScreen">;
/** The canvases of the map, and what is drawn on them. */
interface Canvases {
  back: HTMLCanvasElement;
  front: HTMLCanvasElement;
  layers: Layer[];
  overlay: (f: Drawing) => void;
}
