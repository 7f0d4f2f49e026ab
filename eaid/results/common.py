"""Types that several results share: intervals, sources, solver, errors."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self

import msgspec

from eaid.files import sha256_of
from eaid.findings import Finding, merged, ranked, sentences

if TYPE_CHECKING:
    from collections.abc import Callable

    import pandas

    from eaid.results.fit import Fit
    from eaid.steps.stepset import StepSet

Number = Annotated[float, msgspec.Meta(ge=-1e60, le=1e60)]
"""A finite number of a size that a rig can have; its cube is still a number."""
Positive = Annotated[float, msgspec.Meta(gt=0, le=1e60)]
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
Count = Annotated[int, msgspec.Meta(ge=0, le=10**15)]
Interval = tuple[Number, Number] | None
"""95 % interval [low, high]; None where the data say nothing of use, with a finding that says why."""


class Result(msgspec.Struct, frozen=True):
    """Base of every typed result: immutable, its field names are the keys of the file."""


def ci95_of(item: Any, name: str) -> Interval:
    """The 95 % interval of one value of a result that holds its intervals as `ci95`; None where it has none."""
    return getattr(item.ci95, name) if item.ci95 is not None else None


class Samples:
    """What is behind a fit, while it is in memory: no file holds it, and no comparison of fits asks for it."""

    __slots__ = ("of_logs", "steps")

    def __init__(
        self, steps: "StepSet | None" = None, of_logs: "Callable[[Fit], pandas.DataFrame] | None" = None
    ) -> None:
        self.steps = steps
        self.of_logs = of_logs  # What logs that were fitted as recorded hold, and the plant makes of their inputs

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Samples)

    def __hash__(self) -> int:
        return 0


class Input(Result, frozen=True):
    """A file that a result was made from: the path as given, and its fingerprint."""

    path: str
    sha256: str = ""

    @classmethod
    def of(cls, path: Path) -> Self:
        """A file as it is now."""
        return cls(str(path), sha256_of(path))


Inputs = dict[str, Input | tuple[Input, ...]]
"""The files that a result was made from, by what they are: fit, gains, reference, log."""


class Made(Result, frozen=True, kw_only=True):
    """What every result says of its making, and of itself."""

    command: tuple[str, ...] = ()
    """What was typed to make it, without the output; empty where Python did."""
    seed: int = 0
    """That of its options."""
    findings: tuple[Finding, ...] = ()
    """What is to be known before the numbers are used, worst first."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """The findings that are more than notes, as sentences, the worst of each kind."""
        return tuple(sentences(one for one in ranked(merged(self.findings)) if one.severity != "note"))


class Source(Result, frozen=True):
    """One run behind a fit."""

    path: str = ""
    sha256: str = ""
    run: str = ""
    level: Number | None = None
    """In the input's unit."""
    repeat: Count | None = None
    baseline_nm: Number | None = None
    """Idle output that was subtracted, in the output's unit."""
    step_s: Number | None = None
    """Step instant on the log's own clock [s]."""
    samples: Count | None = None
    edge: str = "rising"


class LogReplayed(Result, frozen=True):
    """A log behind a fit of steps, played again through the plant: what `simulate` with that log gives."""

    run: str
    path: str = ""
    fit_pct: Number | None = None
    rmse: Number | None = None


class StartCost(Result, frozen=True):
    """One start of the solver: the cost at which it ended."""

    cost: Number | None = None


class Solver(Result, frozen=True):
    """How a fit was found, and our own verdict on it."""

    method: str = "SLSQP"
    converged: bool = False
    """Our verdict: what a further constrained Newton step would gain is less than a billionth of the cost."""
    message: str = ""
    """The verdict in words."""
    predicted_decrease: Number | None = None
    """Of the cost by a further constrained Newton step, relative to the cost."""
    evaluations: Count = 0
    starts: tuple[StartCost, ...] = ()
    at_bounds: tuple[str, ...] = ()
    """The constraints that hold the end point: tau1-floor, tau2-meets-tau1, Ts-zero, tau2-endless, C-zero, C-one,
    a0-fastest, a0-slowest; of recorded logs release-tau1-floor, release-tau2-meets-tau1, fall-tau1-least,
    fall-tau2-least, fall-tau1-most, fall-tau2-most, hysteresis-least."""

    @property
    def costs(self) -> tuple[float, ...]:
        """Cost at the end of every start."""
        return tuple(math.nan if start.cost is None else start.cost for start in self.starts)


class AbsError(Result, frozen=True):
    """Mean and standard deviation of |residual|, in the output's unit."""

    mean: Number | None = None
    sd: Number | None = None


class Scores(Result, frozen=True, kw_only=True):
    """How far a curve is from what was recorded: what every fitted curve and every model says of itself."""

    rmse: Number | None = None
    """In the output's unit."""
    sse: Number | None = None
    """Sum of squared residuals over all samples."""
    fit_pct: Number | None = None
    """100 (1 − ‖y − ŷ‖/‖y − mean y‖)"""
    R2: Number | None = None
    """1 − ‖y − ŷ‖²/‖y − mean y‖²"""


class LevelError(Scores, frozen=True):
    """How far a model is from one level's averaged repeats, in the output's unit."""

    level: Number
    abs_error: AbsError | None = None


class HoldOut(Result, frozen=True):
    """Errors on the levels that were left out of the fit."""

    levels: tuple[LevelError, ...] = ()
    rmse: Number | None = None
    fitted_rmse: Number | None = None
    abs_error: AbsError | None = None
