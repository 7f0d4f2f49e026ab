"""A run: one recorded step, as read from a file, in the units that `logs/units.py` turns into."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from eaid.apparatus import Apparatus
from eaid.arrays import Array, read_only
from eaid.findings import Finding
from eaid.options import ExperimentKind

Beside: TypeAlias = tuple[tuple[str, Array], ...]  # Columns by their name in the log
INPUT_UNITS: dict[str, str] = {"clutch": "%", "friction-force": "N", "friction-speed": "RPM"}


@dataclass(frozen=True, eq=False)
class Run:
    """One log, or one step of it: shapes (n,), float64, read-only, time strictly rising."""

    name: str
    time_s: Array  # Time since the log's first sample [s]: 0 first, so that a stamp of 1.7e9 s costs no digit
    input: Array  # Duty, force or speed, in `input_unit`; all NaN where the log has no input column
    output: Array  # Torque, or whatever was recorded, in `output_unit`, as measured (baseline not subtracted)
    input_unit: str
    output_unit: str
    source: str  # The path as the user gave it
    sha256: str
    level: float | None = None  # Level by the file name or a stored attribute; None: that of `input`
    repeat: int | None = None
    step_s: float | None = None  # Step instant [s], on `time_s`, where it was given or stored; None: not known yet
    until_s: float | None = None  # End of the active window [s], on `time_s`, where it was given or stored
    baseline: float | None = None  # Idle output, where it was stored; None: the mean before the step
    edge: Literal["rising", "falling"] = "rising"
    rest_s: float | None = None  # Duration of the rest before the step whose mean its start is [s]; None: not known
    rest_moved: float = 0.0  # How far that rest moved, mean of its second half less that of its first, in `output_unit`
    swept: bool = False  # Whether its log rests so shortly that steps begin on what those before have left
    reference_nm: Array | None = None  # Torque reference of a closed-loop log [N·m], shape (n,); None: the log has none
    # Displacement of a contact that goes to and fro, shape (n,), in `position_unit`; None: the log has none
    position: Array | None = None
    position_unit: str = ""
    findings: tuple[Finding, ...] = ()  # What reading it and finding its step brought up
    kind: ExperimentKind | None = None  # Experiment, as its columns or its dataset say; None: nothing says it
    apparatus: Apparatus | None = None  # Rig, where the file says it
    synthetic: str | None = None  # What made the data, where they are not recorded; None: a rig
    # Input before the step, in `input_unit`: 0 is a step from rest (of a falling edge, where it falls to)
    from_level: float = 0.0
    # Output just before the edge, at the end of the hold or of the idle time, in `output_unit`
    held: float | None = None
    dataset: str = ""  # The dataset it was read from, as the user gave it; empty: read from `source` itself
    start_s: float = 0.0  # The log's own clock at `time_s` = 0 [s]
    # (role, column) that were read, in the order time, input, output, reference
    taken: tuple[tuple[str, str], ...] = ()
    left: tuple[str, ...] = ()  # Columns of the log that were not read
    others: Callable[[], Beside] = tuple  # Reads those among them that move, shape (n,) each; none of cut runs
    moves: tuple[tuple[str, float], ...] = ()  # Of a log without an input: which others leave their rest, and when [s]
    cut: bool = False  # True for one step cut out of a log (or stored so); False: steps are still to be cut out of it

    def __getstate__(self) -> dict[str, Any]:
        """To be pickled: what is read later, by functions that hold open files, is read now."""
        return vars(self) | {"others": partial(tuple, self.others())}

    @property
    def where(self) -> str:
        """How a sentence to the user names this run: its file, and its name where the file holds several."""
        return f"{self.dataset}: run {self.name}" if self.dataset else self.source

    @property
    def has_input(self) -> bool:
        """True where the log has an input column."""
        return bool(len(self.input)) and not bool(np.isnan(self.input[0]) and np.isnan(self.input[-1]))

    def part(self, samples: slice | NDArray[np.intp], **changes: Any) -> "Run":
        """Some of its samples as a run of their own, with other changes."""
        columns = {name: getattr(self, name) for name in ("time_s", "input", "output", "reference_nm", "position")}
        parts = {name: read_only(values[samples]) for name, values in columns.items() if values is not None}
        return replace(self, **{"others": tuple, **parts, **changes})


def numbered(names: Iterable[str], before: str = "-") -> list[str]:
    """Names, each that comes again with its number behind it."""
    times, apart = Counter[str](), list[str]()
    for name in names:
        times[name] += 1
        apart.append(f"{name}{before}{times[name]}" if times[name] > 1 else name)
    return apart
