"""Fields of a description that hold quantities, and the base class of descriptions."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeGuard

import numpy as np
from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, ValidationError
from pydantic_core import CoreSchema, core_schema

from chilopod.errors import ChilopodError, ParameterError, nearest_name
from chilopod.units.expressions import format, kind_of, parse, unit_in

# Far outside anything that walks, and far inside what products and quotients of a few quantities need to stay finite.
_SMALLEST: Final = 1e-12
_LARGEST: Final = 1e9


def as_number(name: str, value: object) -> float:
    """One plain number of any type as a float; it is none of an array that could be changed later."""
    if type(value) is float:
        return value
    try:
        if np.ndim(value) != 0 or np.asarray(value).dtype.kind not in "fiuO":  # type: ignore[arg-type]
            raise TypeError
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise ParameterError("must be a number", field=name, value=value) from None


@dataclass(frozen=True, slots=True)
class Quantity:
    """Definition of the values that a field may hold; used as ``Annotated[float, Quantity(...)]`` in a `Description`.

    Attributes
    ----------
    si
        SI unit of the stored value, radians for angles; empty for a plain number.
    display
        Unit in robot files and messages.
    at_least, at_most
        Range in SI units, both ends included. By default positive numbers of a plausible size.
    integer
        True if only whole numbers are allowed.
    each
        True if the field holds a tuple of such values.
    optional
        True if the field may be None.
    """

    si: str
    display: str
    at_least: float = _SMALLEST
    at_most: float = _LARGEST
    integer: bool = False
    each: bool = False
    optional: bool = False

    def check(self, value: float, given: object = None) -> float:
        """Return `value` (SI units) as a float, an int for whole numbers, if it is in range; otherwise the error
        shows `given`, as the user wrote it, or else the value in the unit of robot files, as its range."""
        value = as_number("", value)
        if self.at_least <= value <= self.at_most and not (self.integer and value != math.floor(value)):
            return int(value) if self.integer else value
        shown = value if given is None else given
        if given is None and self.display and math.isfinite(value):
            shown = format(value, self.display, digits=15)  # all that any double holds
        low, high = (format(end, self.display, digits=6) for end in (self.at_least, self.at_most))
        allowed = f"{low} to {high}"
        if not math.isfinite(value):
            problem = "must be finite"
        elif self.at_least > 0.0 >= value:
            problem = "must be positive"
            allowed = allowed if self.integer else f"more than 0 {self.display}"
        elif self.at_least == 0.0 > value:
            problem, allowed = "must not be negative", f"0 {self.display} or more"
        elif self.integer and self.at_least <= value <= self.at_most:
            problem = "must be a whole number"
        else:
            problem = "out of range"
        if given is not None and self.display != self.si and not (isinstance(given, str) and unit_in(given)):
            allowed += f"; a number without a unit is in {self.si}"
        raise ParameterError(problem, value=shown, allowed=allowed)

    def read(self, value: object) -> float:
        """Read one value, a number in SI units or text with its unit, and check its range."""
        return self.check(parse(value, self.si), given=value)

    def read_field(self, value: object) -> Any:
        """Read the value of a whole field: a value, a tuple of them, or None."""
        if value is None and self.optional:
            return None
        if not self.each:
            return self.read(value)
        if not is_list(value):
            raise ParameterError("must be a list, one value for each", value=value)
        values = []
        for index, item in enumerate(value):
            try:
                values.append(self.read(item))
            except ChilopodError as error:
                error.field = f"[{index}]"
                raise
        return tuple(values)

    def write(self, value: float) -> Any:
        """Form of one value in a robot file: text with its unit, or a whole number."""
        return value if self.integer else format(value, self.display)

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Let pydantic read the field by `read_field` alone."""
        return core_schema.no_info_plain_validator_function(self.read_field)


@dataclass(frozen=True, slots=True)
class Flag(Quantity):
    """A field, or each value of one, that is either true or false."""

    si: str = ""
    display: str = ""
    at_least: float = 0.0
    at_most: float = 1.0
    integer: bool = True

    def check(self, value: float, given: object = None) -> bool:
        """Return whether `value` is 1; a ParameterError if it is neither that nor 0."""
        if not isinstance(value, bool | np.bool_) and as_number("", value) not in (0, 1):
            raise ParameterError("must be true or false", value=value if given is None else given)
        return bool(value)

    def read(self, value: object) -> bool:
        """Read true or false, as such or as text."""
        text = str(value).strip().lower()
        if text not in ("true", "false"):
            raise ParameterError("must be true or false", value=value, allowed="true or false")
        return text == "true"


class Description(BaseModel):
    """Base of the frozen objects that describe a robot; unknown keys are refused, and errors are one line.

    Raises
    ------
    UnitError, ParameterError
        On construction; the message names the first wrong field.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    def __init__(self, /, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise _explained(error, type(self)) from None


def quantities(model: type[Description]) -> dict[str, Quantity]:
    """Return the quantity of each field of `model` that holds one, in order of declaration."""
    return {
        name: extra
        for name, field in model.model_fields.items()
        for extra in field.metadata
        if isinstance(extra, Quantity)
    }


def is_list(value: object) -> TypeGuard[Collection[Any]]:
    """True if `value` stands for several values: a list, tuple or array, and neither text nor a table."""
    return isinstance(value, Collection) and not isinstance(value, str | bytes | Mapping)


def _explained(error: ValidationError, model: type[Description]) -> ChilopodError:
    """Turn pydantic's report into the most helpful single error."""
    found = error.errors(include_url=False)
    # A misspelt key also leaves its right spelling missing; report the misspelling.
    first = next((item for item in found if item["type"] == "extra_forbidden"), found[0])
    field = ".".join(str(part) for part in first["loc"])
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, ChilopodError):
        inner = cause.field or ""
        cause.field = field + inner if inner.startswith("[") or not (field and inner) else f"{field}.{inner}"
        return cause
    if first["type"] == "missing":
        own, part = quantities(model).get(field), model.model_fields[field].annotation
        keys = f"a table of {', '.join(part.model_fields)}" if isinstance(part, type(BaseModel)) else None
        return ParameterError("is missing", field=field, allowed=kind_of(own.si) if own else keys)
    if first["type"] == "extra_forbidden":
        names = list(model.model_fields)
        return ParameterError(
            "unknown key", field=field, allowed=", ".join(names), nearest=nearest_name(str(first["loc"][-1]), names)
        )
    problem = "must be a table" if first["type"] == "model_type" else first["msg"]
    return ParameterError(problem, field=field, value=first["input"])
