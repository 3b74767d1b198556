"""The messages that a run sends to its pages, as types, and the answers to their commands.

mypy checks by them what makes the messages, and `python -m tests.page_types` makes the types of the page's scripts
from them: the second type of an `Annotated` is what a value becomes in JSON. `docs/console-protocol.md` says what the
messages mean.
"""

from __future__ import annotations

from typing import Literal, NotRequired, TypeAlias, TypedDict

from config.mission_step import Frame
from config.places import NoGoAreaConfig, NoGoLineConfig, PlaceConfig, SpeedAreaConfig
from runtime.console.commands.parameters import Parameter
from runtime.console.frames.state_message import Pair, Quad, RobotStatus, Triple
from runtime.recording.folder_files import Completeness
from runtime.support.length_format import Units

Role: TypeAlias = Literal["control", "watch"]
WaypointRow: TypeAlias = tuple[float, float, float | None]
"""x, y, heading in degrees."""


class RingRow(TypedDict):
    """The ring of sensors."""

    mounts: list[Triple]
    """x, y, direction of each."""
    turning: tuple[int, ...]
    half_angle: float
    range_min: float
    range_max: float


class BodyRow(TypedDict):
    """The robot's body."""

    radius: float
    speed_max: float
    turn_max: float


class ModelRow(TypedDict):
    """An object model."""

    name: str
    vertices: tuple[Pair, ...]
    closed: bool
    arc_radius_m: float | None


class NamedRow(TypedDict):
    """A mission that can be started."""

    name: str
    about: str


class SurfacesRow(TypedDict):
    """The surfaces of a world or a known room."""

    drums: list[Triple]
    """x, y, radius."""
    walls: list[Quad]
    polygons: list[list[Pair]]


class SessionInfo(TypedDict):
    """What the settings and the robot say of a session, live or recorded."""

    type: Literal["session"]
    version: str
    name: str | None
    emulated: bool
    units: NotRequired[Units]
    ring: RingRow
    body: BodyRow
    models: list[ModelRow]
    radii: dict[str, float]
    missions: list[NamedRow]
    truth: SurfacesRow | None
    known_room: SurfacesRow | None
    drivers: tuple[str, ...]
    """Installed ones, for a robot's file."""
    parameters: list[Parameter]
    budget_s: float
    period_s: float


class SampleRow(TypedDict):
    """The numbers of a past moment, named as those of a state."""

    robot_s: float
    pose: Triple
    ring_yaw: float
    twist: Pair
    ranges: list[float | None]
    phases: dict[str, float]
    cycle_us: float


class HistoryRow(TypedDict):
    """What a page that joins is sent of the time before."""

    samples: list[SampleRow]
    trail: list[Triple]
    """x, y, time."""


class RobotRow(TypedDict):
    """Another run on this machine or the local network; what it says is not trusted."""

    name: str
    mode: str
    url: str
    version: str


class PlacesMessage(TypedDict):
    """The places on the map."""

    type: Literal["places"]
    frame: Frame
    place: list[PlaceConfig]
    no_go_line: list[NoGoLineConfig]
    no_go_area: list[NoGoAreaConfig]
    speed_area: list[SpeedAreaConfig]


class ClientRow(TypedDict):
    """What a session message says of the client itself."""

    role: Role
    client: int
    has_token: bool


class SessionMessage(SessionInfo, ClientRow):
    """The first message, and again when the robot or its models change."""

    robots: list[RobotRow]
    places: PlacesMessage
    history: NotRequired[HistoryRow]


class ChallengeMessage(TypedDict):
    """The number that commands carry."""

    type: Literal["challenge"]
    number: int


class RobotMessage(RobotStatus):
    """The robot itself, for a client that watches a recording."""

    type: Literal["robot"]


class ParametersMessage(TypedDict):
    """A setting was changed."""

    type: Literal["parameters"]
    parameters: list[Parameter]


class RobotsMessage(TypedDict):
    """Other robots have changed."""

    type: Literal["robots"]
    robots: list[RobotRow]


class RoleMessage(TypedDict):
    """Control has changed hands, or a client asks for it."""

    type: Literal["role"]
    role: Role
    asked_by: str | None
    client: int | None


class LogMessage(TypedDict):
    """A line of the log."""

    type: Literal["log"]
    timestamp: str
    level: str
    event: str
    fields: dict[str, str]


class AnswerMessage(TypedDict):
    """The answer to a command."""

    type: Literal["answer"]
    id: int | None
    ok: bool
    error: str | None
    field: str | None
    data: object


class GridMessage(TypedDict):
    """The evidence grid."""

    type: Literal["grid"]
    on: bool
    x: NotRequired[float]
    y: NotRequired[float]
    cell: NotRequired[float]
    columns: int
    rows: int
    cells: str


class JobMessage(TypedDict):
    """A report or a map that is being made."""

    type: Literal["job"]
    job: int
    kind: Literal["report", "map"]
    file: str
    share: float
    what: str
    made: list[str]
    error: str | None
    over: bool


class OpeningMessage(TypedDict):
    """A recording is being opened for this client."""

    type: Literal["opening"]
    share: float


class ReplayProblemMessage(TypedDict):
    """Something is wrong with the recording that this client plays."""

    type: Literal["replay_problem"]
    error: str


class ListedRecording(TypedDict):
    """A recording that can be opened; what is not known of the one in progress is None."""

    file: str
    bytes: int | None
    modified_s: float | None
    duration_s: float | None
    state: Completeness
    pinned: bool
    live: bool


class RecordingDescription(TypedDict):
    """What a page shows of a recording before it is played."""

    duration_s: float
    cycles: int
    bookmarks: list[tuple[float, str]]
    modes: list[tuple[float, str, str | None]]
    about: SessionInfo
    started: str


class OpenedRecording(RecordingDescription):
    """A recording that a client is shown."""

    file: str


ReadingRow: TypeAlias = tuple[float, float, float | None, float, float]
"""x, y, range, direction, nats."""
CrossReadingRow: TypeAlias = tuple[float, float, float | None, float, float, float, float]
"""The same, and x, y of the sensor that listened where it is another one."""
EvidenceAnswer = TypedDict(  # `for` is a keyword
    "EvidenceAnswer",
    {
        "object": int,
        "model": str,
        "for": float,
        "against": float,
        "readings": list[ReadingRow | CrossReadingRow],
        "lines": list[tuple[int, float, float, float, float, bool]],
        "rivals": tuple[tuple[str, float], ...],
    },
)
"""What supports and opposes an object: `lines` have number, ends x1, y1, x2, y2, and whether they support the object;
`rivals` have label and lead, nats."""


class MissionAnswer(TypedDict):
    """What a mission file holds."""

    name: str
    about: str
    waypoints: tuple[WaypointRow, ...] | None
    """None where it is more than a route."""
    frame: Frame | None


class ChangedValue(TypedDict):
    """A setting that a command has changed."""

    path: str
    value: bool | int | float | str | None


class SettingsRow(TypedDict):
    """A file in the list."""

    kind: str
    name: str
    shipped: bool
    """Whether it comes with the program, and so is not changed."""


class SettingsTable(TypedDict):
    """A table of an installed package in a file, as a form."""

    title: str
    help: str
    fields: list[Parameter]
    """`path` leads from the top of the file, with indices of lists."""


class SettingsText(TypedDict):
    """The text of a file."""

    text: str
    digest: str
    """Of the text; a change is saved only over the text that it was made from."""
    form: list[SettingsTable]
    """What installed packages have in it."""


class ProblemRow(TypedDict):
    """A problem of a text."""

    line: int | None
    text: str


class SettingsCheck(TypedDict):
    """What a changed text would mean."""

    problems: list[ProblemRow]
    """A text that has any is not saved."""
    warnings: list[str]
    difference: str
    """From the file to the text, as `diff -u` writes it; empty where they are equal."""
    form: list[SettingsTable]
    """What installed packages have in the text; empty if it is not TOML."""
