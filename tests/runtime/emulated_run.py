"""A whole run in virtual time on a robot with faults; its objects are compared with the truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from config.load import load_settings
from config.settings import Settings
from config.world import WorldConfig
from drivers.emulator.faults import Fault
from drivers.emulator.memory_transport import MemoryLine
from drivers.emulator.robot_device import GroundTruth
from drivers.messages import Firing, Pose
from drivers.registry import make_device, make_driver
from runtime.cycle.inputs import OperatorInput, Request, gather_inputs
from runtime.cycle.modes import Mode
from runtime.cycle.preparation import fresh_state
from runtime.cycle.step import CycleRecord, apply_command, step
from runtime.timing.refinement_budget import within_quanta_per_cycle

FT = 0.3048


@dataclass
class Run:
    """The program and the emulator in virtual time, cycle by cycle."""

    settings: Settings
    world: WorldConfig
    seed: int
    faults: Sequence[Fault] = ()
    arms: bool = True
    """Whether the robot is armed as soon as it is ready."""
    clock_start_us: int = 0
    preparing: str | None = None
    """While recognition is not ready: how far it is."""
    records: list[CycleRecord] = field(default_factory=list)
    truths: list[GroundTruth] = field(default_factory=list)
    firings: list[Firing] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        settings = self.settings
        self.robot = make_device(
            settings, self.world, self.seed, faults=self.faults, clock_start_us=self.clock_start_us
        )
        self.driver = make_driver(settings)
        self.line = MemoryLine(self.driver, self.robot)
        self.state = fresh_state(settings, recognises=not self.preparing)

    @property
    def run_s(self) -> float:
        return len(self.records) / self.settings.cycle.rate_hz

    @property
    def mode(self) -> Mode:
        return self.state.mode.mode

    def cycle(self, request: Request | None = None) -> CycleRecord:
        run_s = (len(self.records) + 1) / self.settings.cycle.rate_hz
        self.line.exchange(run_s)
        if self.arms and self.mode is Mode.READY:
            request = Request.ARM
        inputs = gather_inputs(self.driver, run_s, OperatorInput(request), preparing=self.preparing)
        record = step(
            self.state, inputs, self.settings, lambda c: apply_command(self.driver, c), within_quanta_per_cycle
        )
        self.firings += inputs.received.firings
        self.notes += inputs.received.notes
        self.records.append(record)
        self.truths.append(self.robot.truth)
        return record

    def until(self, run_s: float) -> None:
        while self.run_s < run_s:
            self.cycle()

    def until_true(self, done: Callable[[], bool], timeout_s: float, request: Request | None = None) -> None:
        """Run cycles, the first with `request`, until a condition holds."""
        give_up_s = self.run_s + timeout_s
        while not done():
            assert self.run_s < give_up_s, (self.state.mode, self.driver.state, self.driver.problem)
            self.cycle(request)
            request = None

    def objects_ft(self) -> list[tuple[float, float]]:
        """Return each object's place in feet as the robot sees it now, by what it believes of its own pose."""
        odometry = self.state.odometry
        if odometry is None:
            return []
        # The ring's direction, not the wheels': it is the ring that sees.
        here = Pose(odometry.pose.x, odometry.pose.y, odometry.ring_yaw).inverse()
        seen = [here.compose(Pose(o.x, o.y, 0.0)) for o in self.state.perception.objects()]
        return [(p.x / FT, p.y / FT) for p in seen]

    def drums_ft(self) -> list[tuple[float, float]]:
        """Return where each drum truly is from the robot, feet."""
        truth = self.robot.truth
        here = Pose(truth.pose.x, truth.pose.y, truth.ring_yaw).inverse()
        seen = [here.compose(Pose(d.x_m, d.y_m, 0.0)) for d in self.world.drum]
        return [(p.x / FT, p.y / FT) for p in seen]

    def errors_ft(self) -> list[float]:
        """Return how far each object is from the nearest drum, feet."""
        drums = self.drums_ft()
        return [min(math.dist(seen, drum) for drum in drums) for seen in self.objects_ft()]


def hallway(seed: int, *faults: Fault, method: str = "bayes", arms: bool = True, clock_start_us: int = 0) -> Run:
    settings = load_settings("hallway", [f"perception.method={method}"])
    assert settings.world is not None
    return Run(settings, settings.world, seed, faults, arms, clock_start_us)
