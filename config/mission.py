"""A mission file: steps of motor schemas, and the conditions that lead from one step to another.

A mission is a finite state machine. Its first step is where it begins. Each step sums its schemas and has a list
`until` of conditions; the first that holds names the next step, or how the mission ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

from pydantic import Field, model_validator

from config.files import did_you_mean
from config.mission_step import (
    DONE,
    FAILED,
    NEXT,
    STEPS_MAX,
    TARGETS,
    ApproachObjectUse,
    Condition,
    MoveToGoalUse,
    Name,
    ReachedCondition,
    SeenCondition,
    UnseenCondition,
)
from config.schema_use import SchemaUse
from config.strict import Strict, TomlList


class StepConfig(Strict):
    """A step: the schemas that drive the robot, and the conditions that end it."""

    name: Name
    schemas: TomlList[SchemaUse] = Field(default=(), max_length=8)
    """Without any the robot stands: a step that waits."""
    avoid_gain: float = Field(default=1.0, ge=0.0, le=100.0)
    """Factor on avoid-static-obstacle, which is part of every step. The arbiter's clearance applies in any case."""
    stuck_after_s: float = Field(default=30.0, ge=1.0, le=1e5)
    """Time without progress after which the step is stuck, s."""
    unreachable_after_s: float = Field(default=120.0, ge=1.0, le=1e5)
    """A goal to which the robot has come no nearer for so long, although it drives, is unreachable, s."""
    until: TomlList[Condition] = Field(default=(), max_length=16)
    """The conditions, first match first; by default the next step follows when the step's schema arrives."""

    @property
    def arrives(self) -> bool:
        """Whether a schema of the step can arrive."""
        return sum(use.arrives for use in self.schemas) > 0

    @cached_property
    def goal(self) -> MoveToGoalUse | None:
        """The place to which the step drives, if it is one of `move_to_goal`."""
        return next((use for use in self.schemas if isinstance(use, MoveToGoalUse)), None)

    @cached_property
    def gains(self) -> dict[str, float]:
        """The gains that the step gives the schemas which lead nowhere by themselves, by their names."""
        return {use.name: getattr(use, "gain", 1.0) for use in self.schemas if not use.leads}

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """The conditions, with the default."""
        return self.until or ((ReachedCondition(when="reached"),) if self.arrives else ())

    @model_validator(mode="after")
    def _can_end(self) -> StepConfig:
        if sum(use.arrives for use in self.schemas) > 1:
            raise ValueError("two of the schemas can arrive, so `reached` has two meanings: make two steps of them")
        names = [use.name for use in self.schemas]
        if "turn" in names and len(names) > 1:
            raise ValueError("the schema turn stands alone in its step, as the robot turns on the spot")
        self._check_helpers(names)
        if self.goal is None and any(condition.when == "unreachable" for condition in self.until):
            raise ValueError(f"until: the step {self.name} has no goal that could be unreachable: use stuck")
        if not self.arrives and any(condition.when == "reached" for condition in self.until):
            raise ValueError(f"until: nothing in the step {self.name} can be reached: give a time or a way instead")
        if not self.conditions:
            raise ValueError(f"the step {self.name} never ends: give it `until`, for example a time")
        return self

    def _check_helpers(self, names: Sequence[str]) -> None:
        """Refuse schemas that lead nowhere by themselves where they have nothing to work on, or stand twice."""
        for name in self.gains:
            if names.count(name) > 1:
                raise ValueError(f"the schema {name} stands twice: leave one of them out")
        if "leave_canyon" in names and self.goal is None:
            raise ValueError("leave_canyon goes round what closes the way to a goal: add move_to_goal")
        for name in {"follow_valley", "swirl"}.intersection(names):
            if not any(use.leads for use in self.schemas):
                raise ValueError(f"{name} needs a way: add a schema that leads somewhere, for example move_ahead")


class MissionConfig(Strict):
    """A mission: its steps, of which the first is where it begins."""

    name: Name
    about: str = Field(default="", max_length=500)
    """What the robot does, for the operator."""
    endless: bool = False
    """Whether it may go on until the operator stops it, as a patrol does."""
    step: TomlList[StepConfig] = Field(min_length=1, max_length=STEPS_MAX)
    """The steps."""

    @model_validator(mode="after")
    def _is_sound(self) -> MissionConfig:
        problems = list(_problems(self.step, endless=self.endless))
        if problems:
            raise ValueError("; ".join(problems[:10]))
        return self

    def index(self, target: str, at: int) -> int | None:
        """Return the number of the step to which a condition of the step `at` leads; None for an end or hold."""
        if target == NEXT:
            return at + 1 if at + 1 < len(self.step) else None
        return next((i for i, step in enumerate(self.step) if step.name == target), None)

    @cached_property
    def needs_map(self) -> bool:
        """Whether a step drives in the map, or depends on the robot's place there."""
        uses = (use for step in self.step for use in step.schemas)
        frames = {getattr(use, "frame", None) or getattr(use, "relative_to", None) for use in uses}
        return "map" in frames or any(c.when == "lost" for step in self.step for c in step.conditions)

    @cached_property
    def needs_objects(self) -> bool:
        """Whether a schema or a condition looks for an object."""
        return bool(self.objects())

    def places(self) -> set[str]:
        """Return the names of all places to which steps drive."""
        return {step.goal.place for step in self.step if step.goal is not None and step.goal.place is not None}

    def objects(self) -> set[str]:
        """Return the names of all objects that schemas and conditions look for."""
        parts = [part for step in self.step for part in (*step.schemas, *step.until)]
        return {
            part.object for part in parts if isinstance(part, ApproachObjectUse | SeenCondition | UnseenCondition)
        }


def _name_problems(names: list[str]) -> Iterator[str]:
    """Yield what is wrong with the names of the steps."""
    for name in dict.fromkeys(name for name in names if names.count(name) > 1):
        yield f"two steps are named {name}: give each a name of its own"
    for name in (name for name in names if name in TARGETS):
        yield f"a step cannot be named {name}, which is what conditions name: choose another name"


def _problems(steps: tuple[StepConfig, ...], *, endless: bool) -> Iterator[str]:
    """Yield what is wrong with the steps as a state machine."""
    names = [step.name for step in steps]
    yield from _name_problems(names)
    known, is_complete = (*names, *TARGETS), True
    leads: dict[str, list[str]] = {name: [] for name in names}
    for i, step in enumerate(steps):
        following = names[i + 1] if i + 1 < len(names) else DONE
        for condition in step.conditions:
            if condition.go not in known:
                near = did_you_mean(condition.go, known) or f"; steps: {', '.join(names)}"
                yield f"the step {step.name} goes to {condition.go} on {condition.when}: there is no such step{near}"
                is_complete = False
            leads[step.name].append(following if condition.go == NEXT else condition.go)
    if not is_complete:
        return
    reached = _reachable(names[0], leads)
    for name in dict.fromkeys(name for name in names if name not in reached):
        yield f"the step {name} is never reached: let a condition of another step go to it, or leave it out"
    if endless:
        return
    for name in (name for name in names if name in reached):
        if not _reachable(name, leads) & {DONE, FAILED}:
            yield (
                f"from the step {name} the mission never ends: let a condition go to done or failed, or set "
                "endless = true"
            )
            return


def _reachable(first: str, leads: dict[str, list[str]]) -> set[str]:
    """Return every name to which conditions lead from one, that one included."""
    found, todo = {first}, [first]
    while todo:
        for target in leads.get(todo.pop(), ()):
            if target not in found:
                found.add(target)
                todo.append(target)
    return found
