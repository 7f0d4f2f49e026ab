"""How a result shows itself: one line at a prompt, its summary when printed, summary and table in a notebook."""

import math
from collections.abc import Sequence
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pandas  # which others take from here
else:

    class _WhenAsked:
        """pandas, loaded when it is first asked for something: a command that makes no table goes without."""

        def __getattr__(self, name: str) -> Any:
            return getattr(import_module("pandas"), name)

    pandas = _WhenAsked()

QUANTITIES = {"N·m": "torque", "N": "force", "RPM": "speed", "kPa": "stress", "°C": "temperature"}
INPUT_WORDS = {"%": "duty", "N": "force", "RPM": "speed", "V": "voltage", "bar": "pressure", "A": "current"}


def counted(count: int, noun: str) -> str:
    """`1 run`, `27 runs`, `2 stretches`."""
    ending = "" if count == 1 else "es" if noun.endswith(("ch", "sh", "s")) else "s"
    return f"{count} {noun}{ending}"


def listed(names: Sequence[str], most: int) -> str:
    """The first names: `a, b, c and 4 more`."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def number(value: object, digits: int = 4) -> str:
    """A number with so many significant digits and a true minus sign; what is no finite number becomes a dash."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return str(value).replace("-", "−")
    if not isinstance(value, float) or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e5:
        decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
        said = f"{value:.{decimals}f}"
    else:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        said = f"{mantissa}e{int(exponent)}"
    return said.replace("-", "−")


def span(levels: Sequence[float], unit: str) -> str:
    """`1 level, 50 %`, `10 levels, 10 … 100 %`."""
    if not levels:
        return "no levels"
    ends = " … ".join(f"{one:.4g}" for one in dict.fromkeys((levels[0], levels[-1])))
    return f"{counted(len(levels), 'level')}, {ends} {unit}".rstrip()


def output_word(unit: str) -> str:
    """What an output in this unit is called: only one in N·m is a torque."""
    return QUANTITIES.get(unit, "output")


def input_word(unit: str) -> str:
    """What levels of an input in this unit are called: only one in % is a duty."""
    return INPUT_WORDS.get(unit, "level")


class Shown:
    """What every public result inherits; it has a `summary()` and a `to_frame()`."""

    __slots__ = ()

    def summary(self) -> str:
        """The result in a few lines, the gravest findings last."""
        raise NotImplementedError

    def to_frame(self) -> "pandas.DataFrame":
        """The result as one table."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.summary().partition(chr(10))[0]}>"

    def __str__(self) -> str:
        return self.summary()

    def _repr_html_(self) -> str:
        table = self.to_frame().to_html(max_rows=30, float_format="{:.4g}".format)
        return f"<pre>{escape(self.summary())}</pre>{table}"


class Plotted(Shown):
    """A result that can be drawn: the responses of a fit, the gain margins of gains over the held input, a replay."""

    __slots__ = ()

    def plot(self, ax: Any = None) -> Any:
        """The result on matplotlib Axes."""
        import eaid

        return eaid.plot(self, ax)  # type: ignore[arg-type]
