"""`compare`: what moved between sessions, whether alike at all levels, and whether gains have to be made anew.

Of levels that both sessions hold, δ = ln θ_A − ln θ_B with the covariance V = W_A + W_B: levels that share the p
coefficients of a curve are off together. The common shift is m = w'δ, w as the diagonal of V weighs, with the variance
w'Vw, held against Student's t; Q = (δ − m)' K⁺ (δ − m), K what V leaves of the distances to m (of T_s its diagonal, as
each level has its own), over its p − 1 (L − 1) degrees of freedom against F tells whether all moved alike. Degrees of
freedom are Welch's of each level, averaged as the levels weigh. Of several numbers and sessions the probabilities are
Holm's.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from string import ascii_uppercase
from typing import ClassVar

import numpy as np
from msgspec.structs import asdict, replace
from scipy.special import fdtrc, stdtrit

from eaid.arrays import Array
from eaid.control.defaults import input_limits
from eaid.control.gains import law_of, plant_of, refuse_other_units
from eaid.control.margins import ENOUGH_DB, ENOUGH_DEG, enough, least_margins, points_of
from eaid.errors import DataError, in_python
from eaid.estimate.coefficients import CURVES_ORDER
from eaid.findings import sentences
from eaid.findings.row import NUMBER_NAMES, SYMBOLS
from eaid.options import CompareOptions
from eaid.plant.forms import terms
from eaid.results import codec
from eaid.results.common import Inputs, Made, Number, Result, ci95_of
from eaid.results.fit import Fit
from eaid.results.gains import Gains, Margin
from eaid.sessions.gather import (
    ASSUMED_DEGREES,
    EXACT,
    MANY,
    NO_INTERVAL,
    RESPONSES,
    SessionValue,
    interpolated,
    of_whole_plant,
    plant_moved,
    snapped,
    told_together,
    unseen_scatter,
    values_of_fit,
)
from eaid.sessions.loop import Promise
from eaid.sessions.model import chance_beyond
from eaid.shown import Plotted, pandas
from eaid.steps.levels import same_level

MOVED_CHANCE = 0.05
NO_MORE = 1e-9  # Of the largest direction in which a curve is free, below which one is none
HARDLY = 1.1  # Factor up to which what has not moved for certain is the same
SAME_B = 1.05  # Factor by which a B is no other, where all levels that gains were made for have the same one
CLAIMED = ("Ts", *RESPONSES)  # What a session is asked for, told whether it moved or not
LETTERS = (*ascii_uppercase, *("".join(two) for two in product(ascii_uppercase, repeat=2)))
CALLED = SYMBOLS | {"omega": NUMBER_NAMES["omega"], "held": "held output", "peak": "peak"}


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
        return self.p < MOVED_CHANCE

    @property
    def alike(self) -> bool:
        """Whether they all moved alike."""
        return self.p_alike is None or self.p_alike >= MOVED_CHANCE

    @property
    def changed(self) -> bool:
        """Whether the levels moved, together or apart."""
        return self.moved or not self.alike

    @property
    def suspect(self) -> bool:
        """Whether its interval leaves out 1 and reaches beyond `HARDLY`, though as one of several numbers it has not
        moved for certain."""
        return self.verdict == "unclear" and not self.low <= 1 <= self.high

    @property
    def verdict(self) -> str:
        """moved; apart, some levels; same, within `HARDLY`; unclear, where the interval reaches further."""
        if self.changed:
            return "moved" if self.moved else "apart"
        return "same" if self.low >= 1 / HARDLY and self.high <= HARDLY else "unclear"

    def words(self) -> str:
        """`T_s −52 % (−57 … −47; p 2e-27), not alike at all levels (p 0.005): …`."""
        ends = f"{_pct(self.low)} … {_pct(self.high)}"
        of_all = "" if self.moved or self.low <= 1 <= self.high else ", being one of several numbers"
        said = f"{CALLED[self.quantity]} {_pct(self.ratio)} % ({ends}; p {self.p:.2g}{of_all})"
        if self.p_alike is None:
            return said + (f", seen at {self.levels[0].level:.4g} only" if len(self.levels) == 1 else "")
        if self.alike:
            return f"{said}, alike at all levels (p {self.p_alike:.2g})"
        rising = sorted(self.levels, key=lambda one: one.ratio)
        apart = ", ".join(f"{_pct(one.ratio)} % at {one.level:.4g}" for one in (rising[0], rising[-1]))
        return f"{said}, not alike at all levels (p {self.p_alike:.2g}): {apart}"


class Retune(Result, frozen=True):
    """Whether A's B leaves the range that gains were made for."""

    B_m: Number
    B_M: Number
    needed: bool | None
    """None: a level's B lies outside by more than a standard error, but not its whole interval."""
    outside: tuple[Number, ...] = ()
    """Levels at which it does."""
    lacking: dict[str, Margin] = {}
    """Loops that have had 6 dB and 45° and have not on its plant, behind its dead time: the least margins there."""
    session: str = "A"
    """Letter of the session that is held against the gains: A, or the other one, of which they were not made."""
    B: tuple[Number, ...] = ()
    """B at those levels."""
    unseen: bool = False
    """Whether they are levels at which the gains' own fit has none."""

    def words(self) -> str:
        """The answer, and why."""
        its = f"B = 1/b of session {self.session}"
        if self.lacking:
            each = ", ".join(f"{name} {_margins_said(one)}" for name, one in self.lacking.items())
            return f"yes: on {self.session}'s plant the loops lack 6 dB and 45° ({each})"
        made = f"{self.B_m:.4g} … {self.B_M:.4g}"
        at = ", ".join(f"{B:.4g} at {u:.4g}" for u, B in zip(self.outside, self.B, strict=False))
        if self.needed:
            return f"yes: {its} leaves the range that the gains were made for, {made}: {at}"
        if self.needed is None:
            unsure, unseen = "but not for certain; a reference step more tells", "where the gains' fit has no level"
            why = unseen if self.unseen else unsure
            return f"perhaps: {its} lies outside the range that the gains were made for, {made}: {at}, {why}"
        but = f"; its interval reaches beyond: {at}" if at else ""
        return f"no: {its} stays within the range that the gains were made for, {made}{but}"


class Comparison(Plotted, codec.Saved, Made, frozen=True):
    """A session against others; or a recorded loop against what its fit and gains promise."""

    FILE: ClassVar[str] = "compare"
    inputs: Inputs = {}
    options: CompareOptions = CompareOptions()
    input_unit: str = ""
    output_unit: str = ""
    files: dict[str, str] = {}
    """Letter of each session → its file."""
    values: dict[str, tuple[SessionValue, ...]] = {}
    """T_s of each session, for the picture."""
    shifts: tuple[Shift, ...] = ()
    retune: Retune | None = None
    promise: Promise | None = None

    @property
    def changed(self) -> bool:
        """Whether T_s, the held output or the peak moved, in the mean or at some levels, against any of the others; or
        the dead time, or C."""
        return bool(self.plant_words) or any(one.quantity in CLAIMED and one.changed for one in self.shifts)

    @property
    def plant_words(self) -> list[tuple[str, str]]:
        """Of a dead time and a C that are others: `A against B` and `dead time 0.06 s for 0 s`."""
        said = "{what} {a:.3g}{unit} for {b:.3g}{unit}"
        return [(one.subject, said.format(**one.values)) for one in self.findings if one.code == "plant-moved"]

    @property
    def tune_anew(self) -> bool | None:
        """Whether gains are to be made anew: B of the session in question left their range, or where none are given A
        moved. None: perhaps, as a reference step tells, or the gains do."""
        if self.retune is not None:
            return bool(self.files) and self.retune.needed
        return self.changed or (None if any(one.changed or one.suspect for one in self.shifts) else False)

    @property
    def in_question(self) -> str:
        """The file of the session that gains are held against, or are to be made for."""
        return self.files["A" if self.retune is None else self.retune.session]

    @property
    def retuning(self) -> str:
        """Whether to make gains anew, in words."""
        if self.retune is not None:
            return self.retune.words()
        moved = ", ".join(CALLED[one.quantity] for one in self.shifts if one.changed)
        suspect = ", ".join(CALLED[one.quantity] for one in self.shifts if one.suspect)
        if self.changed:
            said = "likely, as A moved"
        elif moved or suspect:
            said = f"perhaps, as {moved or suspect} {'moved' if moved else 'may have moved'}"
        else:
            said = "no sign of it"
        return f"{said}; «gains» gains.json holds the range of the gains against A"

    def lines(self) -> list[str]:
        """The verdict."""
        said = [f"{letter}       {name}" for letter, name in self.files.items()]
        told = (one for one in self.shifts if one.quantity in CLAIMED or one.changed or one.suspect)
        said += [f"{one.verdict:7} A against {one.against}: {one.words()}" for one in told]
        said += [f"moved   {subject}: {words}" for subject, words in self.plant_words]
        if self.files:
            said.append(f"retune  {self.retuning}")
        return said + (self.promise.lines() if self.promise is not None else [])

    def summary(self) -> str:
        """The verdict, and the gravest findings."""
        return in_python("\n".join([*self.lines(), *sentences(self.findings[:3])]))

    def to_frame(self) -> "pandas.DataFrame":
        """One row a number, session and level: ratio with its interval."""
        rows = [(one.quantity, one.against, level) for one in self.shifts for level in one.levels]
        return pandas.DataFrame([{"quantity": of, "against": other, **asdict(level)} for of, other, level in rows])


def _margins_said(one: Margin) -> str:
    if not one.stable:
        return "unstable"
    parts = ((one.gain_db, ENOUGH_DB, " dB"), (one.phase_deg, ENOUGH_DEG, "°"))
    lacking = ((value, unit) for value, least, unit in parts if value is not None and value < least)
    return " and ".join(f"{np.floor(10 * value) / 10:.3g}{unit}" for value, unit in lacking)


def _pct(ratio: float) -> str:
    pct = 100 * (ratio - 1)
    return f"{pct:+.{0 if abs(pct) >= 9.95 else 1}f}".replace("-", "−")


def compare_fits(fits: Mapping[str, Fit], gains: Gains | None, options: CompareOptions) -> Comparison:
    """The first session against each of the others; DataError where they are not of one rig, or share no level."""
    told = told_together(fits)
    if unknown := [name for name, fit in fits.items() if not values_of_fit(fit, "Ts", name)]:
        raise DataError(f"{unknown[0]}: {NO_INTERVAL}")
    letters, shifts = dict(zip(fits, LETTERS, strict=False)), list[Shift]()
    first, *others = fits
    of_them = [name for name, fit in fits.items() if gains is not None and made_of(gains, fit)]
    asked = others[0] if of_them == [first] and len(others) == 1 else first
    for name in others:
        each = (_shift(quantity, letters[name], fits[first], fits[name]) for quantity in CALLED)
        found = [one for one in each if one is not None]
        if not any(one.quantity == "Ts" for one in found):
            raise DataError(f"{name}: shares no level with {first} at which both know T_s; record one that it holds")
        shifts += found
        told += plant_moved(f"A against {letters[name]}", fits[first], fits[name])
    p, p_alike = holm([one.p for one in shifts]), holm([1.0 if one.p_alike is None else one.p_alike for one in shifts])
    held = [replace(one, p=p[k], p_alike=None if one.p_alike is None else p_alike[k]) for k, one in enumerate(shifts)]
    data = fits[first].data
    return Comparison(
        options=options, input_unit=data.input_unit, output_unit=data.output_unit, shifts=tuple(held),
        files={letter: name for name, letter in letters.items()},
        values={letter: tuple(values_of_fit(fits[name], "Ts", letter)) for name, letter in letters.items()},
        retune=None if gains is None else _retune(fits[asked], gains, letters[asked]), findings=tuple(told),
    )  # fmt: skip


def _shift(quantity: str, letter: str, one: Fit, other: Fit) -> Shift | None:
    """One number against another session's at the levels that both hold; None where they hold none."""
    of_one, of_other = _seen(one, quantity, "A"), _seen(other, quantity, letter)
    if not other.data.levels:  # whose inputs move, and are shown at some
        of_other = interpolated(of_other, [value.level for value in of_one])
    elif not one.data.levels:
        of_one = interpolated(of_one, [value.level for value in of_other])
    both = snapped([*of_one, *of_other])
    a, b = ({value.level: value for value in both if value.session == of} for of in ("A", letter))
    levels = sorted(a.keys() & b.keys())
    if not levels:
        return None
    one_of, other_of = (np.array([(of[u].value, of[u].sd_log ** 2, of[u].dof) for u in levels]).T for of in (a, b))
    delta, own = np.log(one_of[0] / other_of[0]), one_of[1] + other_of[1]
    welch = np.minimum(own**2 / (one_of[1] ** 2 / one_of[2] + other_of[1] ** 2 / other_of[2]), MANY)
    weight = (1 / own) / (1 / own).sum()
    spreads = [_session_covariance(fit, quantity, [of[u] for u in levels]) for fit, of in ((one, a), (other, b))]
    V, apart, spare = spreads[0][0] + spreads[1][0], spreads[0][1] + spreads[1][1], max(one[2] for one in spreads) - 1
    m, error, degrees = float(weight @ delta), float(np.sqrt(weight @ V @ weight)), float(weight @ welch)
    Q = _unlike(delta - m, apart, weight, spare)
    reach = stdtrit(welch, 0.975) * np.sqrt(own)
    rows = zip(levels, *np.exp([delta, delta - reach, delta + reach]).tolist(), strict=True)
    changes = () if of_whole_plant(one, quantity) else tuple(Change(*row) for row in rows)
    ratio, low, high = np.exp(m + np.array([0.0, -1.0, 1.0]) * stdtrit(degrees, 0.975) * error).tolist()
    alike = float(fdtrc(spare, float(welch.min()), Q / spare)) if spare else None
    p = chance_beyond(m / error, degrees)
    return Shift(quantity, letter, ratio, low, high, p, alike, degrees, changes)


def _session_covariance(fit: Fit, quantity: str, values: Sequence[SessionValue]) -> tuple[Array, Array, int]:
    """Covariance of a session's values, that of their distances to their mean, (L, L) each, and how many numbers these
    follow from: curves have their coefficients, each level that was held a T_s of its own, though all rest on the same
    τ."""
    shared, part = unseen_scatter(fit, quantity), fit.nonlinear
    sd = np.sqrt(np.maximum(np.square([one.sd_log for one in values]) - shared**2, EXACT**2))
    alone, known = np.diag(sd**2), None if part is None else part.covariance
    if quantity not in CURVES_ORDER or part is None or known is None or not known.matrix:
        return alone + shared**2, alone, len(values)
    at = [k for k, name in enumerate(known.order) if name.startswith(quantity)]
    rows = terms(np.array([one.level for one in values]), len(at), part.parameters.u_range)
    rows = rows / np.array([[one.value] for one in values])
    of_curve = rows @ np.array(known.matrix)[np.ix_(at, at)] @ rows.T
    size = np.sqrt(np.maximum(np.diag(of_curve), 1e-300))
    together = of_curve * np.outer(sd / size, sd / size)
    if quantity == "Ts" and fit.data.levels:
        return together + shared**2, alone, len(values)
    return together + shared**2, together, int(np.linalg.matrix_rank(of_curve, rtol=NO_MORE))


def _unlike(off: Array, V: Array, weight: Array, spare: int) -> float:
    """The squared distance of levels to their common shift, in the `spare` directions in which they can be unlike."""
    about = np.eye(len(off)) - np.outer(np.ones(len(off)), weight)
    size, ways = np.linalg.eigh(about @ V @ about.T)
    top = slice(len(off) - spare, None)
    return float(((ways[:, top].T @ off) ** 2 / np.maximum(size[top], 1e-300)).sum())


def _seen(fit: Fit, quantity: str, letter: str) -> list[SessionValue]:
    """What a session has shown of a number: of one known by reference steps, at their levels only."""
    values, steps = values_of_fit(fit, quantity, letter), {source.level for source in fit.data.sources}
    if (shared := unseen_scatter(fit, quantity)) > 0:
        wider = [(float(np.hypot(one.sd_log, shared)), min(one.dof, ASSUMED_DEGREES)) for one in values]
        values = [replace(one, sd_log=sd, dof=dof) for one, (sd, dof) in zip(values, wider, strict=True)]
    return [one for one in values if one.level in steps or not fit.of_sessions]


def holm(p: Sequence[float]) -> list[float]:
    """Holm's probabilities of several tests, each as good as all that are smaller."""
    order = np.argsort(p, kind="stable")
    rising = np.maximum.accumulate(np.minimum(1.0, np.arange(len(p), 0, -1) * np.array(p)[order]))
    return rising[np.argsort(order)].tolist()  # type: ignore[no-any-return]


def made_of(gains: Gains, fit: Fit) -> bool:
    """Whether gains were made of a fit, by its linear model."""
    numbers = ([getattr(one, name) for name in ("a0", "b0", "c0")] for one in (gains.model, fit.linear) if one)
    return fit.linear is not None and len(set(map(tuple, numbers))) == 1


def _retune(fit: Fit, gains: Gains, letter: str) -> Retune:
    """Whether B of a fit stays within the range of gains; DataError where one of them does not say it."""
    refuse_other_units(fit, gains)
    if gains.rc is None or gains.rc.B_m is None or gains.rc.B_M is None:
        raise DataError("the gains hold no range of B; make them with eaid tune-rc")
    if fit.linear is None:
        raise DataError(f"the fit {letter} holds no linear model, so no B; fit it with «model» linear too")
    B_m, B_M, kept = gains.rc.B_m, gains.rc.B_M, fit.linear.bounds.levels if fit.linear.bounds is not None else ()
    each = (row for row in fit.linear.per_level if row.level in kept or not kept)
    ends = ci95_of(fit.linear, "b0")  # of 1/B, where levels have no interval of their own
    part = (fit.linear.b0 / ends[1], fit.linear.b0 / ends[0]) if ends and ends[0] > 0 else (1.0, 1.0)
    rows = [(row.level, row.B, ci95_of(row, "B") or (row.B * part[0], row.B * part[1])) for row in each if row.B]
    low, high = min(B_m, B_M / SAME_B), max(B_M, B_m * SAME_B)
    out = tuple(u for u, B, _ in rows if not low <= B <= high)

    def beyond(part: float) -> tuple[float, ...]:
        """Levels outside by a part of their interval and of the range's, which rests on a fit as good."""
        reach = part * 2**0.5
        return tuple(u for u, B, ci in rows if B * (ci[1] / B) ** reach < low or B * (ci[0] / B) ** reach > high)

    own = [point.duty_pct for point in gains.margins.points] if gains.margins is not None else []
    sure = tuple(u for u in beyond(1.0) if not own or any(same_level(u, one, 0.0) for one in own))
    unsure, lacking = beyond(0.5), lacking_loops(fit, gains)
    at = sure or unsure or out
    needed = True if sure or lacking else None if unsure else False
    unseen = needed is None and not any(same_level(u, one, 0.0) for u in at for one in own)
    return Retune(B_m, B_M, needed, at, lacking, letter, tuple(B for u, B, _ in rows if u in at), unseen)


def lacking_loops(fit: Fit, gains: Gains) -> dict[str, Margin]:
    """The loops of gains that were made with 6 dB and 45°, and lack them on the plant of a fit behind its dead time."""
    plant, made = plant_of(fit), gains.margins
    if plant is None or made is None:
        return {}
    points = points_of(fit, plant, gains.model, (), input_limits(fit))
    rate_hz = made.timing.rate_hz
    late = max(made.timing.delay_samples, fit.latest_dead_time_s * rate_hz)
    timing, found = replace(made.timing, delay_samples=late), dict[str, Margin]()
    for name, worst in made.worst.items():
        if enough(worst) and (law := law_of(gains, name)) is not None:
            least = least_margins(law, points, timing)
            found |= {} if enough(least) else {name: least}
    return found
