"""What the user may say about logs that do not say it themselves."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from eaid.errors import UsageError
from eaid.logs.run import Kind, Run

ROLES = ("time", "input", "output", "reference", "position")


@dataclass(frozen=True)
class ReadOptions:
    """Settings of `read_runs`; every one of them may be left out. Raises UsageError where one cannot be meant."""

    columns: Mapping[str, str] = field(default_factory=dict)
    """Role (time, input, output, reference, position) → column name, or its number from 1."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Role (time, input, output, position) → unit the column is in; `/255`: counts, of which 255 are the full scale."""
    name_pattern: str | None = None
    """Found anywhere in the file name, with `{level}` and `{repeat}` in it: `_V={level}_`."""
    step_at_s: float | None = None
    """Step instant on the log's own clock [s]; since its first sample where that lies outside the log."""
    until_s: float | None = None
    """End of the active window, on the same clock [s]."""
    repair: bool = False
    """Drop bad rows, up to 1 % of a log, and say how many."""
    kind: Kind | None = None
    variable: str | None = None
    """Which table of a file with several: a MAT variable, an HDF5 path, a TDMS group."""
    rate_hz: float | None = None
    """Sample rate of logs without a time column [Hz]."""
    tell: Callable[[str, float], None] = lambda _source, _share: None
    """Hears how much of a long log is read, from 0 to 1."""
    each: Callable[[Run], Run] = lambda run: run
    """Applied to every run of a dataset before the next is read, so that long ones need not lie in memory together."""
    join: bool = False
    """All logs of the call are one run, cut by the logger: join them by time."""

    def __post_init__(self) -> None:
        unknown = [role for role in (*self.columns, *self.units) if role not in ROLES]
        if unknown:
            raise UsageError(f"«columns» and «units» know {', '.join(ROLES[:-1])} and {ROLES[-1]}, not {unknown[0]}")
        fields = re.findall(r"\{(level|repeat)\}", self.name_pattern or "")
        if self.name_pattern and not fields:
            raise UsageError(f"«name_pattern» {self.name_pattern}: holds neither {{level}} nor {{repeat}}")
        if len(set(fields)) < len(fields):
            raise UsageError(f"«name_pattern» {self.name_pattern}: holds a field twice")

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        parts = re.split(r"\{(level|repeat)\}", self.name_pattern or "")
        forms = {"level": r"(?P<level>[+-]?\d+(?:[.,]\d+)?)", "repeat": r"(?P<repeat>\d+)"}
        return re.compile("".join(forms[part] if i % 2 else re.escape(part) for i, part in enumerate(parts)))

    def of_name(self, name: str) -> tuple[float | None, int | None]:
        """Level and repeat that the name of a log tells by the name pattern."""
        found = self._pattern.search(name) if self.name_pattern else None
        said = found.groupdict() if found else {}
        level, repeat = said.get("level"), said.get("repeat")
        return float(level.replace(",", ".")) if level else None, int(repeat) if repeat else None
