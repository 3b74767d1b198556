"""A whole run in virtual time on a robot with faults; its objects are compared with the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from config.load import load_settings
from config.settings import Settings
from config.world import WorldConfig
from drivers.emulator.faults import Fault
from drivers.emulator.memory_transport import MemoryLine
from drivers.messages import Firing, Pose
from drivers.registry import make_device, make_driver
from perception.pipeline import Perception
from runtime.cycle.inputs import Request, gather_inputs
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord, State, apply_command, step
from runtime.timing.refinement_budget import within_quanta_per_cycle

FT = 0.3048


@dataclass
class Run:
    """The program and the emulator, cycle by cycle; armed as soon as it is ready."""

    settings: Settings
    world: WorldConfig
    seed: int
    faults: Sequence[Fault] = ()
    arms: bool = True
    cycles: int = 0
    firings: list[Firing] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        settings = self.settings
        self.robot = make_device(settings, self.world, self.seed, faults=self.faults)
        self.driver = make_driver(settings)
        self.line = MemoryLine(self.driver, self.robot)
        self.state = State(Perception(settings.ring, settings.models, settings.perception))

    @property
    def run_s(self) -> float:
        return self.cycles / self.settings.cycle.rate_hz

    def cycle(self) -> CycleRecord:
        self.cycles += 1
        self.line.exchange(self.run_s)
        request = Request.ARM if self.arms and self.state.mode.mode is Mode.READY else None
        inputs = gather_inputs(self.driver, self.run_s, request)
        record = step(
            self.state, inputs, self.settings, lambda c: apply_command(self.driver, c), within_quanta_per_cycle
        )
        self.firings += inputs.received.firings
        self.notes += inputs.received.notes
        return record

    def until(self, run_s: float) -> None:
        while self.run_s < run_s:
            self.cycle()

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


def hallway(seed: int, *faults: Fault, method: str = "bayes", sets: Sequence[str] = ()) -> Run:
    settings = load_settings("hallway", [f"perception.method={method}", *sets])
    assert settings.world is not None
    return Run(settings, settings.world, seed, faults)
