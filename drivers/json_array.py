"""How an array of numbers goes into JSON and comes back to the bit.

Messages are plain dataclasses; whoever records them reads their fields' types. An array's type alone says nothing
about a text form, so it is annotated with this one: a list, in which NaN and the infinities are left to the reader's
and writer's own rule.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema


@dataclass(frozen=True, slots=True)
class NumberList:
    """Annotation of an array of shape (n,) that pydantic is to write as a list of numbers."""

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Return the schema; called by pydantic."""
        numbers = core_schema.list_schema(core_schema.float_schema())
        written = core_schema.plain_serializer_function_ser_schema(_as_list, return_schema=numbers)
        return core_schema.no_info_before_validator_function(
            _as_list, core_schema.no_info_after_validator_function(_as_array, numbers), serialization=written
        )


def _as_list(value: object) -> object:
    return value.tolist() if isinstance(value, np.ndarray) else value


def _as_array(values: list[float]) -> NDArray[np.float64]:
    return np.array(values, dtype=np.float64)
