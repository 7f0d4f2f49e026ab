"""One row of the table of sentences."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

# stop: the number must not be used. caution: read this before it is. note: good to know
Severity = Literal["stop", "caution", "note"]

Values = Mapping[str, Any]
SYMBOLS = {"Ts": "T_s", "tau1": "τ1", "tau2": "τ2"}  # Parameters as sentences write them; others by their names
NUMBER_NAMES = {**SYMBOLS, "gain_below": "gain below rest", "omega": "ω", "zeta": "ζ", "dead_time_s": "dead time"}


@dataclass(frozen=True)
class Row:
    """How grave a finding of one code is, and what is said of it."""

    severity: Severity
    # A `str.format` text over the finding's values, `subject`, `levels` in words, `at` (`at 10 and 20 %`) and the
    # `symbol` of its `parameter`; or a function of these and of `each`, the levels as numbers. An option stands in
    # guillemets, `«rest»`: the command line says `--rest`, Python `rest=`.
    template: str | Callable[[Values], str]
    size: str = ""  # The value by which the worst of several findings of this code is known; empty: the first of them
    always: bool = False  # Told even where only the gravest few are: data were changed
    # Its place among those of one severity: -1 a value is not what its name says, 0 the data ask for another model, 1 a
    # model is not identifiable or a unit is unknown, 3 what follows from others
    rank: int = 2
    covers: tuple[str, ...] = ()  # Codes that say less of the same thing: they are not told beside this one
    first: str = ""  # What to do by hand before gains are built on the fit
    refit: str = ""  # Options of another fit that mends it, a `str.format` text over its values
    unless: str = ""  # Code beside which those options mend nothing


stop, caution, note = partial(Row, "stop"), partial(Row, "caution"), partial(Row, "note")  # Rows of each severity
