"""`compare`: what moved between sessions, whether alike at all levels, and whether gains have to be made anew.

Of levels that both sessions hold, δ = ln θ_A − ln θ_B with the variance V = W_A + W_B. The common shift is
m = Σ (δ/V)/Σ (1/V), held against Student's t; Q = Σ (δ − m)²/V over its L − 1 degrees of freedom against F tells
whether all levels moved alike. Degrees of freedom are Welch's of each level, averaged as the levels weigh. Of several
numbers and sessions the probabilities are Holm's.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar

import msgspec
import numpy as np
from scipy.special import fdtrc, stdtrit

from eaid.control.gains import refuse_other_units
from eaid.errors import DataError
from eaid.findings import sentences
from eaid.findings.row import SYMBOLS
from eaid.options import CompareOptions
from eaid.results import codec
from eaid.results.common import Inputs, Interval, Made, Number, Result
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.sessions.gather import Value, snapped, together, values_of
from eaid.sessions.loop import Promise
from eaid.sessions.model import two_sided
from eaid.shown import Plotted

if TYPE_CHECKING:
    import pandas

CHANCE = 0.05
LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


class Change(Result, frozen=True):
    """One level: by what factor A lies above the other, with its 95 % interval."""

    level: Number
    ratio: Number
    low: Number
    high: Number


class Shift(Result, frozen=True):
    """One number of A against that of another session."""

    quantity: str
    against: str
    """Letter of the other session."""
    ratio: Number
    """A over the other, common to all levels, with its 95 % interval."""
    low: Number
    high: Number
    p: Number
    """Probability of so large a common shift by chance, after Holm."""
    p_alike: Number | None = None
    """Probability of levels so unlike by chance, after Holm; None: one level."""
    dof: Number = 0.0
    levels: tuple[Change, ...] = ()

    @property
    def moved(self) -> bool:
        """Whether the levels moved together."""
        return self.p < CHANCE

    @property
    def alike(self) -> bool:
        """Whether they all moved alike."""
        return self.p_alike is None or self.p_alike >= CHANCE

    def words(self) -> str:
        """`T_s −52 % (−57 … −47; p 2e-27), not alike at all levels (p 0.005): …`."""
        name, ends = SYMBOLS.get(self.quantity, self.quantity), f"{_pct(self.low)} … {_pct(self.high)}"
        said = f"{name} {_pct(self.ratio)} % ({ends}; p {self.p:.2g})"
        if self.p_alike is None:
            return said
        if self.alike:
            return f"{said}, alike at all levels (p {self.p_alike:.2g})"
        ends_ = sorted(self.levels, key=lambda one: one.ratio)
        apart = ", ".join(f"{_pct(one.ratio)} % at {one.level:.4g}" for one in (ends_[0], ends_[-1]))
        return f"{said}, not alike at all levels (p {self.p_alike:.2g}): {apart}"


class Retune(Result, frozen=True):
    """Whether A's B leaves the range that gains were made for."""

    B_m: Number
    B_M: Number
    needed: bool | None
    """None: a level's B lies outside, but not its whole interval."""
    levels: tuple[tuple[Number, Number, Interval], ...] = ()
    """Level, B and its interval."""
    outside: tuple[Number, ...] = ()

    def words(self) -> str:
        """The answer, and why."""
        made, at = f"{self.B_m:.4g} … {self.B_M:.4g}", ", ".join(f"{u:.4g}" for u in self.outside)
        if self.needed:
            return f"yes: A's B leaves the range that the gains were made for ({made}) at {at}"
        if self.needed is None:
            return f"perhaps: A's B lies outside {made} at {at}, but not for certain; a reference step more tells"
        return f"no: A's B stays within the range that the gains were made for ({made})"


class Comparison(Plotted, codec.Saved, Made, frozen=True):
    """A session against others; or a recorded loop against what its fit and gains promise."""

    FILE: ClassVar[str] = "compare"
    inputs: Inputs = {}
    options: CompareOptions = CompareOptions()
    input_unit: str = ""
    output_unit: str = ""
    files: dict[str, str] = {}
    """Letter of each session → its file or name."""
    values: dict[str, tuple[Value, ...]] = {}
    """T_s of each session, for the picture."""
    shifts: tuple[Shift, ...] = ()
    retune: Retune | None = None
    promise: Promise | None = None

    @property
    def changed(self) -> bool:
        """Whether T_s moved, in the mean or at some levels, against any of the others."""
        return any(one.quantity == "Ts" and (one.moved or not one.alike) for one in self.shifts)

    def lines(self) -> list[str]:
        """The verdict."""
        said = [f"{letter}       {name}" for letter, name in self.files.items()]
        for one in self.shifts:
            if one.quantity == "Ts" or one.moved or not one.alike:
                word = "moved  " if one.moved or not one.alike else "held   "
                said.append(f"{word} A against {one.against}: {one.words()}")
        if self.retune is not None:
            said.append(f"retune  {self.retune.words()}")
        return said + (self.promise.lines() if self.promise is not None else [])

    def summary(self) -> str:
        """The verdict, and the gravest findings."""
        return "\n".join([*self.lines(), *sentences(self.findings[:3])])

    def to_frame(self) -> "pandas.DataFrame":
        """One row a number, session and level: ratio with its interval."""
        import pandas as pd

        rows = [
            {"quantity": one.quantity, "against": one.against, **msgspec.structs.asdict(level)}
            for one in self.shifts for level in one.levels
        ]  # fmt: skip
        return pd.DataFrame(rows)


def _pct(ratio: float) -> str:
    pct = 100 * (ratio - 1)
    return f"{pct:+.{0 if abs(pct) >= 9.95 else 1}f}".replace("-", "−")


def compare_fits(fits: Mapping[str, Fit], gains: Gains | None, options: CompareOptions) -> Comparison:
    """The first session against each of the others; DataError where they are not of one rig, or share no level."""
    together(fits)
    names, shifts = dict(zip(LETTERS, fits, strict=False)), list[Shift]()
    first, *others = fits
    for letter, name in list(names.items())[1:]:
        found = [
            shift for quantity in ("Ts", "tau1", "tau2")
            if (shift := _shift(quantity, letter, fits[first], fits[name])) is not None
        ]  # fmt: skip
        if not any(one.quantity == "Ts" for one in found):
            raise DataError(f"{name}: shares no level with {first} at which both know T_s; record one that it holds")
        shifts += found
    p = holm([one.p for one in shifts])
    alike = iter(holm([one.p_alike for one in shifts if one.p_alike is not None]))
    held = tuple(
        msgspec.structs.replace(one, p=p[k], p_alike=None if one.p_alike is None else next(alike))
        for k, one in enumerate(shifts)
    )
    data = fits[first].data
    return Comparison(
        options=options, input_unit=data.input_unit, output_unit=data.output_unit, files=names, shifts=held,
        values={letter: values_of(fits[name], "Ts", letter) for letter, name in names.items()},
        retune=None if gains is None else _retune(fits[first], gains),
    )  # fmt: skip


def _shift(quantity: str, letter: str, one: Fit, other: Fit) -> Shift | None:
    """One number against another session's at the levels that both hold; None where they hold none."""
    both = snapped([*values_of(one, quantity, "A"), *values_of(other, quantity, letter)])
    each = [{value.level: value for value in both if value.session == of} for of in ("A", letter)]
    levels = sorted(set(each[0]) & set(each[1]))
    if not levels:
        return None
    a, b = ([of[u] for u in levels] for of in each)
    delta = np.log([x.value / y.value for x, y in zip(a, b, strict=True)])
    W = np.array([(x.sd_log**2, y.sd_log**2) for x, y in zip(a, b, strict=True)])
    dof = np.array([(x.dof, y.dof) for x, y in zip(a, b, strict=True)])
    V = W.sum(axis=1)
    welch = V**2 / (W**2 / dof).sum(axis=1)
    weight = (1 / V) / (1 / V).sum()
    m, error, degrees = float(weight @ delta), float((1 / V).sum() ** -0.5), float(weight @ np.minimum(welch, 1e9))
    Q, spare = float(((delta - m) ** 2 / V).sum()), len(levels) - 1
    reach = stdtrit(np.minimum(welch, 1e12), 0.975) * np.sqrt(V)
    rows = zip(levels, *np.exp([delta, delta - reach, delta + reach]).tolist(), strict=True)
    ends = np.exp(m + np.array([0.0, -1.0, 1.0]) * stdtrit(min(degrees, 1e12), 0.975) * error).tolist()
    return Shift(
        quantity, letter, *ends, two_sided(m / error, degrees),
        float(fdtrc(spare, degrees, Q / spare)) if spare else None, degrees, tuple(Change(*row) for row in rows),
    )  # fmt: skip


def holm(p: Sequence[float]) -> list[float]:
    """Holm's probabilities of several tests, each as good as all that are smaller."""
    held, largest = [0.0] * len(p), 0.0
    for rank, k in enumerate(sorted(range(len(p)), key=p.__getitem__)):
        largest = max(largest, min(1.0, (len(p) - rank) * p[k]))
        held[k] = largest
    return held


def _retune(fit: Fit, gains: Gains) -> Retune:
    """Whether B of a fit stays within the range of gains; DataError where one of them does not say it."""
    refuse_other_units(fit, gains)
    if gains.rc is None or gains.rc.B_m is None or gains.rc.B_M is None:
        raise DataError("the gains hold no range of B; make them with eaid tune-rc")
    if fit.linear is None:
        raise DataError("the first fit holds no linear model, so no B; fit it with «model» linear too")
    B_m, B_M, kept = gains.rc.B_m, gains.rc.B_M, fit.linear.bounds.levels if fit.linear.bounds is not None else ()
    rows = [row for row in fit.linear.per_level if row.B is not None and (row.level in kept or not kept)]
    ends = [row.ci95.B if row.ci95 is not None else None for row in rows]
    out = [row.level for row in rows if not B_m <= (row.B or 0.0) <= B_M]
    sure = [row.level for row, one in zip(rows, ends, strict=True) if one is not None and (one[1] < B_m or one[0] > B_M)]
    levels = tuple((row.level, row.B or 0.0, one) for row, one in zip(rows, ends, strict=True))
    return Retune(B_m, B_M, True if sure else None if out else False, levels, tuple(sure or out))
