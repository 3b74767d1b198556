"""The schemas that a mission's step can name: the one list of the shipped ones, and those of installed packages."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, Final, TypeAlias, get_args

from pydantic import Field, SerializeAsAny, ValidationError, ValidatorFunctionWrapHandler, WrapValidator

from config.mission_step import (
    ApproachObjectUse,
    AvoidPastUse,
    FollowValleyUse,
    FollowWallUse,
    LeaveCanyonUse,
    MoveAheadUse,
    MoveToGoalUse,
    NoiseUse,
    SearchUse,
    StayOnPathUse,
    SwirlUse,
    TurnUse,
    Use,
    WanderUse,
)
from config.plugins import located, plugged_use, validated


def _with_plugged(value: object, shipped: ValidatorFunctionWrapHandler) -> object:
    """Return the settings of a schema that an installed package adds, or of a shipped one."""
    name = value.get("name") if isinstance(value, dict) else None
    use = plugged_use(name) if isinstance(name, str) and name not in SHIPPED_USES else None
    if use is None:
        return value if isinstance(value, Use) else shipped(value)
    try:
        return validated(use, value)
    except ValidationError as error:
        raise ValidationError.from_exception_data(use.__name__, list(located(error, str(name)))) from None


SchemaUse: TypeAlias = Annotated[
    MoveAheadUse
    | MoveToGoalUse
    | TurnUse
    | WanderUse
    | FollowWallUse
    | StayOnPathUse
    | ApproachObjectUse
    | SearchUse
    | FollowValleyUse
    | LeaveCanyonUse
    | AvoidPastUse
    | NoiseUse
    | SwirlUse,
    Field(discriminator="name"),
    WrapValidator(_with_plugged),
    SerializeAsAny(),
]
"""A schema of a step with its settings: the one list of those that are shipped. `behaviors.schema_registry` has a
function for each; an installed package's has its own."""

SHIPPED_USES: Final[Mapping[str, type[Use]]] = MappingProxyType(
    {get_args(use.model_fields["name"].annotation)[0]: use for use in get_args(get_args(SchemaUse)[0])}
)
"""The settings of each shipped schema by its name."""
