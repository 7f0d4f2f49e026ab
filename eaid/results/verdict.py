"""The one verdict on a fit: whether it may be used or is NOT USABLE, and why.

The terminal, the page, the mark on figures, `tune-rc`, `simulate`, `export` and what is offered next read this alone.
A fit is not usable where a model of its own fails: its solver did not converge, it explains little, it has a curve that
no plant has within the identified inputs, its steady output lies beyond ten times what was reached, or the data leave
that, or the linear model, open by a factor of a hundred. A run or a level that is stopped is left out of the fit and
named; what the data do not determine is a warning.
"""

from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from eaid.arrays import Array, median
from eaid.errors import in_python
from eaid.findings import Finding, enumerated, finding, merged, ranked, say, stops
from eaid.plant import linear
from eaid.plant.dynamics import CHECKED_INPUTS, Plant
from eaid.plant.respond import from_rest
from eaid.results.common import Interval, ci95_of
from eaid.shown import counted

if TYPE_CHECKING:
    from eaid.results.fit import Fit

MODEL_PARTS = ("friction", "nonlinear", "linear", "release")
PLANT_MODELS = ("nonlinear", "release")  # Models that a replay's plant is made of
TIMES_REACHED = 10.0  # Steady output over the largest that was reached, from which it is none that the data show
FACTOR = 100.0  # Ends of an interval so far apart say nothing
BETWEEN = 10  # Inputs from one at which the constraints of a fit hold to the next
INPUTS_CHECKED = BETWEEN * (CHECKED_INPUTS - 1) + 1  # Evenly over the identified range
SLOWEST_TAU_S = 1e9
LARGEST_OUTPUT = 1e15  # Steady output of any rig, whatever its units
NEARLY_MEET = 1e-3  # Share of the largest value by which τ2 may lie below τ1
DEAD_ZONE = 0.02  # Part of the largest T_s by which a polynomial may fall below 0: the plant stays at 0 there


class Verdict(msgspec.Struct, frozen=True):
    """Whether a fit may be used, and the findings that say why not; true of it means that it may.

    Examples
    --------
    >>> Verdict(), Verdict(warnings=(finding("tau2-open", "nonlinear"),))
    (usable, usable; 1 warning: τ2 open)
    """

    reasons: tuple[Finding, ...] = ()
    warnings: tuple[Finding, ...] = ()
    """What is to be known before it is used, the worst of each kind."""

    def __bool__(self) -> bool:
        return self.usable

    def __repr__(self) -> str:
        if self.reasons:
            return f"NOT USABLE: {self.why}"
        said = f": {', '.join(map(in_short, self.warnings))}" if self.warnings else ""
        usable = f"usable{f', not at {enumerated(self.not_at)}' if self.not_at else ''}"
        return f"{usable}; {counted(len(self.warnings), 'warning')}{said}" if said else usable

    @property
    def not_at(self) -> tuple[float, ...]:
        """Levels of a usable fit at which its plant explains nothing: it must not be used there."""
        return tuple(u for one in self.warnings if one.code == "curve-misses-levels" for u in one.levels)

    @property
    def usable(self) -> bool:
        """Whether nothing speaks against it."""
        return not self.reasons

    @property
    def why(self) -> str:
        """The reasons as sentences; empty for a usable fit."""
        return in_python(self.sentence)

    @property
    def sentence(self) -> str:
        """The same with its options yet to be written as Python or the command line does."""
        return "; ".join(map(say, self.reasons))

    def of(self, *models: str) -> "Verdict":
        """The verdict on some of the models: what speaks against others alone is left out."""
        others = set(MODEL_PARTS).difference(models)
        both = (tuple(one for one in some if one.subject not in others) for some in (self.reasons, self.warnings))
        return Verdict(*both)


def in_short(finding: Finding) -> str:
    """A finding by its code: `repeats disagree`, `τ2 open`."""
    return finding.code.replace("-", " ").replace("tau", "τ")


def verdict_of(fit: "Fit") -> Verdict:
    """The verdict on a fit, from the findings of severity stop and from its own numbers."""
    told = stops(fit.findings)
    known = {(one.code, one.subject) for one in told}
    warnings = tuple(one for one in ranked(merged(fit.findings)) if one.severity == "caution")
    return Verdict((*told, *(one for one in failures(fit) if (one.code, one.subject) not in known)), warnings)


def judged(fit: "Fit") -> "Fit":
    """The fit with all that speaks against it among its findings."""
    others = (one for one in fit.findings if one.severity != "stop")
    return msgspec.structs.replace(fit, findings=ranked((*verdict_of(fit).reasons, *others)))


def failures(fit: "Fit") -> list[Finding]:
    """What the numbers of the models themselves say against them."""
    found = []
    for name in MODEL_PARTS:
        solver = getattr(getattr(fit, name), "solver", None)
        if solver is not None and not solver.converged:
            found.append(finding("fit-not-converged", name, predicted_decrease=solver.predicted_decrease))
    if fit.converged is False and not found:
        found.append(finding("fit-not-converged", "fit"))
    shapeless = (any(said.code == "shape-explains-little" for said in one.findings) for one in fit.steps)
    if fit.steps and not any(getattr(fit, name) for name in MODEL_PARTS) and all(shapeless):
        found.append(finding("no-step-has-a-shape", "steps"))
    played = [one.fit_pct for one in fit.data.replayed if one.fit_pct is not None]
    missed = {u for one in fit.findings if one.code == "curve-misses-levels" for u in one.levels}
    if (missed and missed >= set(fit.data.levels)) or (played and median(played) < 0):
        found.append(finding("model-explains-little", "nonlinear"))
    return [*found, *_nonlinear(fit), *_linear(fit)]


def _nonlinear(fit: "Fit") -> list[Finding]:
    part = fit.nonlinear
    if part is None and fit.plant_ is None:
        return []
    p = fit.plant
    found = unphysical(p)
    highest = float(np.max(p.steady(np.linspace(*p.u_range, INPUTS_CHECKED))))
    reached = [float(from_rest(p, np.array([end]), u)[0]) for u, end in _records(fit)]
    found += _beyond(fit, "nonlinear", highest, reached)
    known = [row for row in fit.level_values if row.ci95 is not None]
    open_at = [row.level for row in known if _says_nothing(ci95_of(row, "Ts"))]
    if 2 * len(open_at) > len(known):
        found.append(finding("steady-output-unknown", "nonlinear", open_at, unit=fit.data.input_unit))
    return found


def _linear(fit: "Fit") -> list[Finding]:
    part = fit.linear
    if part is None or not part.a0 > 0:
        return []
    p = part.parameters
    tops = [linear.steady(p, u) for u, _ in _records(fit)]
    reached = [float(linear.linear_response(p, np.array([end]), u)[0]) for u, end in _records(fit)]
    found = _beyond(fit, "linear", max(tops, default=0.0), reached)
    for name in ("a0", "b0"):
        ends = ci95_of(part, name)
        if ends is not None and _says_nothing(ends):
            found.append(finding("linear-parameter-unknown", "linear", parameter=name, low=ends[0], high=ends[1]))
    return found


def _records(fit: "Fit") -> list[tuple[float, float]]:
    """Levels, and how long each was recorded [s]."""
    data = fit.data
    return list(zip(data.levels, data.record_s, strict=True)) if len(data.levels) == len(data.record_s) else []


def _beyond(fit: "Fit", model: str, steady: float, reached: list[float]) -> list[Finding]:
    """A steady output beyond what was reached: at the ends of the records, or by logs as they were recorded."""
    reached = [*map(abs, reached), *(abs(y - (log.idle or 0.0)) for log in fit.logs for y in log.curve.measured)]
    largest = max(reached, default=0.0)
    if not largest > 0 or abs(steady) <= TIMES_REACHED * largest:
        return []
    unit = fit.data.output_unit
    return [finding("steady-beyond-output", model, steady=steady, reached=largest, unit=unit)]


def _says_nothing(ends: Interval) -> bool:
    """Whether an interval is unknown, or its ends lie a factor of a hundred apart."""
    return ends is None or not 0 < ends[1] <= FACTOR * ends[0]


def unphysical(p: Plant) -> list[Finding]:
    """Curves that, within the identified inputs, are none that a plant has; the first place of each."""
    inputs = np.linspace(*p.u_range, INPUTS_CHECKED)
    (tau1, tau2), Ts = p.time_constants(inputs), p.curve(inputs)
    held_above = np.arange(INPUTS_CHECKED) % BETWEEN == 0  # there alone
    floor = np.where(held_above, p.floor_s / 2, -np.inf)
    cases: list[tuple[str, Array, Any, float]] = [
        ("tau1", tau1, p.floor_s / 2, SLOWEST_TAU_S),
        ("tau2", tau2, np.maximum(tau1 - NEARLY_MEET * np.max(tau2), floor), SLOWEST_TAU_S),
        ("Ts", Ts, -DEAD_ZONE * np.max(Ts) if np.max(Ts) > 1 / LARGEST_OUTPUT else 1 / LARGEST_OUTPUT, LARGEST_OUTPUT),
    ]
    if p.kind == "lag":
        del cases[1]
    if p.signed:
        cases[-1] = ("Ts", Ts, -LARGEST_OUTPUT, LARGEST_OUTPUT)
    found = []
    for name, values, least, most in cases:
        wrong = ~((values >= least) & (values <= most))
        if wrong.any():
            k = int(wrong.argmax())
            crossed = name == "tau2" and bool(0 < values[k] < tau1[k])
            value, at = float(values[k]), float(inputs[k])
            found.append(finding("curve-of-no-plant", "nonlinear", name=name, value=value, input=at, crossed=crossed))
    return found
