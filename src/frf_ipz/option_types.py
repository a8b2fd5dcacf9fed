"""What values of options may be: types that pydantic checks, and that the reference of the files is written from.

Numbers are strict: TOML tells numbers, texts and truth values apart, so a length of "0.5" or of true is a slip. None is
infinite or no number.
"""

from __future__ import annotations

import datetime
import re
from typing import Annotated

from pydantic import AfterValidator, Field, PlainValidator

LARGEST = 1e30  # in SI units: beyond, squares and products overflow, and nothing is so large
SMALLEST = 1e-30  # of what is above 0
MOST = 10**6  # of what is counted; beyond, memory and time have no end
LARGEST_HZ = 1e9  # beyond any vibration: a frequency that was meant otherwise
ISO_DAY = re.compile(r"\d{4}-\d{2}-\d{2}")


def _require_size(value: float) -> float:
    if 0.0 < value < SMALLEST:
        raise ValueError(f"must be greater than {SMALLEST:g}: smaller sizes are those of nothing")
    return value


def _require_day(value: object) -> str:
    """Take a date as TOML has it, or any text; one that looks like an ISO date is a day of the calendar."""
    if isinstance(value, datetime.date):
        return value.isoformat()
    if not isinstance(value, str):
        raise ValueError("must be a date such as 2026-11-27, or a text")  # noqa: TRY004  what pydantic collects
    day = ISO_DAY.match(value)
    if day is not None:
        try:
            datetime.date.fromisoformat(day[0])
        except ValueError:
            raise ValueError("must be a day of the calendar, as YYYY-MM-DD") from None
    return value


Positive = Annotated[float, Field(gt=0, le=LARGEST, allow_inf_nan=False, strict=True), AfterValidator(_require_size)]
NotNegative = Annotated[float, Field(ge=0, le=LARGEST, allow_inf_nan=False, strict=True), AfterValidator(_require_size)]
Finite = Annotated[float, Field(allow_inf_nan=False, strict=True)]
Ratio = Annotated[float, Field(ge=0, lt=1, allow_inf_nan=False, strict=True)]
Frequency = Annotated[float, Field(ge=0, le=LARGEST_HZ, allow_inf_nan=False, strict=True)]
Count = Annotated[int, Field(ge=1, le=MOST, strict=True)]
CountOrNone = Annotated[int, Field(ge=0, le=MOST, strict=True)]
Seed = Annotated[int, Field(ge=0, strict=True)]
Node = Annotated[int, Field(ge=1, strict=True)]
NodeOrGround = Annotated[int, Field(ge=0, strict=True)]
ColumnNumber = Annotated[int, Field(strict=True)]
Truth = Annotated[bool, Field(strict=True)]
Name = Annotated[str, Field(min_length=1)]
Day = Annotated[str, PlainValidator(_require_day)]
