"""`sessions`: fits of several mountings of one rig, or a plain table → what the next one may be, rig.json."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import msgspec
import numpy as np
from scipy.special import stdtrit

from eaid.arrays import Array, median
from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding, ranked, sentences
from eaid.findings.row import SYMBOLS
from eaid.options import SessionsOptions
from eaid.results import codec
from eaid.results.common import Inputs, Made, Number, Positive, Result
from eaid.results.fit import Fit
from eaid.results.statistics import as_numbers
from eaid.results.verdict import FACTOR
from eaid.sessions import gather
from eaid.sessions.gather import RESPONSES, WHOLE_NUMBERS, Session, SessionValue
from eaid.sessions.model import NO_STEPS, KnownValues, Next, SessionModel, as_known, steps_known
from eaid.shown import Plotted, counted, pandas

TELLING = 1.005  # Factor from which one reach is told to be less than another
LEAST_SESSIONS = 3  # Sessions that tell how much they differ
FEW_SESSIONS = 5  # Sessions below which that is known to a factor only
MANY_SESSIONS = 8  # From which they tell at which level gain and tilt are apart
CARRIES = 0.5  # Part of its width that the next session's interval keeps where one session carried it
TREND_CHANCE = 0.05
BEYOND = 1.25  # Factor by which a level may lie beyond those of the sessions
COMPONENTS = ("gain", "tilt", "session × level")
# What is known of each session; the first one has to be
SESSION_NUMBERS = ("Ts", "tau1", "tau2", "B", *WHOLE_NUMBERS, *RESPONSES)


class SessionScatter(Result, frozen=True):
    """Standard deviations of ln θ over the sessions: gain, tilt over ln level, session at a level."""

    gain: Number = 0.0
    tilt: Number = 0.0
    level: Number = 0.0


class Foreseen(Result, frozen=True):
    """The next session at one level, with its 95 % interval."""

    level: Positive
    value: Number
    low: Number
    high: Number
    dof: Number
    factor: Number
    """high/value."""
    with_step: Number
    """The same once one reference step is known."""


class Quantity(Result, frozen=True):
    """One number of the rig over its sessions."""

    unit: str
    reference_level: Positive
    terms: int
    """Of the common line in ln level; 0: one a level."""
    values: tuple[SessionValue, ...]
    sd: SessionScatter
    sd_step: Number
    """Standard deviation of ln θ of a reference step, by how much single runs scatter."""
    best_level: Positive
    """Of a single reference step: the one that leaves least of the next session open."""
    more_repeats: Number = 0.0
    """Factor at the worst level if every level had one repeat in three more."""
    next: tuple[Foreseen, ...] = ()

    @property
    def factor(self) -> float:
        """By what factor the next session's interval reaches at the worst level."""
        return max(one.factor for one in self.next)

    @property
    def with_step(self) -> float:
        """The same once one reference step at the best level is known."""
        return max(one.with_step for one in self.next)

    def model(self, names: Sequence[str]) -> SessionModel:
        """Its model over the sessions of these names."""
        variances = np.square(msgspec.structs.astuple(self.sd))
        return SessionModel(_as_known(self.values, names), self.reference_level, self.terms, variances)


class Rig(Plotted, codec.Saved, Made, frozen=True):
    """A rig over its sessions: what they have in common, how they differ, what the next one may be."""

    FILE: ClassVar[str] = "rig"
    inputs: Inputs = {}
    options: SessionsOptions = SessionsOptions()
    input_unit: str = ""
    sessions: tuple[Session, ...] = ()
    quantities: dict[str, Quantity] = {}
    """The main one first: Ts, then tau1, tau2, B, a0, held, peak where three sessions know them; of a table `value`."""
    base: Fit | None = None
    """The fit of the session with the most levels, from which that of today is made; None: a plain table."""

    def __post_init__(self) -> None:
        if not self.quantities:
            raise ValueError("a rig without quantities")

    @property
    def names(self) -> list[str]:
        """The sessions in order."""
        return [one.name for one in self.sessions]

    @property
    def main(self) -> Quantity:
        """The first of the quantities."""
        return next(iter(self.quantities.values()))

    @property
    def symbol(self) -> str:
        """How it is written."""
        name = next(iter(self.quantities))
        return SYMBOLS.get(name, name)

    def foreseen(self, levels: Array, steps: KnownValues = NO_STEPS, quantity: str = "") -> Next:
        """The next session's values of a quantity, of the main one where none is named."""
        return (self.quantities[quantity] if quantity else self.main).model(self.names).next(levels, steps)

    def next(
        self, levels: "Sequence[float] | None" = None, steps: "pandas.DataFrame | None" = None, quantity: str = ""
    ) -> "pandas.DataFrame":
        """What the next session may be.

        Parameters
        ----------
        levels : sequence of floats, optional
            Levels, in the input's unit; by itself those of the sessions.
        steps : DataFrame, optional
            Reference steps of that session, columns level and value; sd_log where a step is known better or worse
            than a single run.
        quantity : str, optional
            Which of `quantities`; by itself the main one.

        Returns
        -------
        DataFrame
            Over the level: value, low and high of its 95 % interval, dof.

        Raises
        ------
        UsageError
            Another quantity than the sessions know, a level that none of them reaches, or steps that are no table.
        """
        if quantity and quantity not in self.quantities:
            raise UsageError(f"«quantity» {quantity}: the sessions know {', '.join(self.quantities)}")
        of, shown = self.quantities[quantity] if quantity else self.main, NO_STEPS
        if steps is not None:
            if not isinstance(steps, pandas.DataFrame | Mapping):
                raise UsageError("«steps»: give a DataFrame with the columns level and value, a reference step a row")
            rows = gather.table_values(pandas.DataFrame({"session": "", "sd_log": of.sd_step, **steps}))
            shown = steps_known((one.level, one.value, one.sd_log) for one in rows)
        held = [one.level for one in of.next]
        at = np.atleast_1d(as_numbers("levels", held if levels is None else levels))
        low, high = held[0] / BEYOND, held[-1] * BEYOND
        if outside := [u for u in at.tolist() if not low <= u <= high]:
            raise UsageError(
                f"«levels» {outside[0]:g}: the sessions hold {held[0]:g} … {held[-1]:g}, and tell nothing of so far off"
            )
        found = self.foreseen(at, shown, quantity)
        columns = dict(zip(("value", "low", "high", "dof"), (found.value, *found.ends, found.dof), strict=True))
        return pandas.DataFrame(columns, index=pandas.Index(at, name="level"))

    def today(self, step: Any) -> Fit:
        """A fit of today by reference steps: `eaid.today(rig, step)`."""
        import eaid

        return eaid.today(self, step)

    @property
    def confounded(self) -> bool:
        """Whether levels and sessions cannot be told apart, so that a reference step tells of some levels only."""
        return any(one.code == "levels-and-sessions-confounded" for one in self.findings)

    @property
    def gives_today(self) -> bool:
        """Whether a reference step makes a fit of today: not of a table, nor where it tells of some levels only."""
        return self.base is not None and not self.confounded

    @property
    def best_step(self) -> str:
        """The level of the reference step that is worth most, with its unit."""
        return f"{self.main.best_level:.4g} {self.input_unit}".rstrip()

    @property
    def advice(self) -> str:
        """What to record next."""
        if self.confounded:
            return "in each session a level of the others too, so that a reference step tells of all levels"
        return f"in each new session first a reference step at {self.best_step}, which is worth most"

    def lines(self) -> list[str]:
        """What is known of the next session, and what to record."""
        one, n = self.main, len(self.sessions)
        narrower = math.sqrt((1 + 1 / (n + 1)) / (1 + 1 / n)) * float(stdtrit(n, 0.975) / stdtrit(n - 1, 0.975))
        by_session = one.factor**narrower
        why = "sessions, not repeats: " * (one.more_repeats > max(0.95 * one.factor, TELLING * by_session))
        more = (
            f"advice  {why}one more repeat to every three leaves ×/÷ {one.more_repeats:.2f}, one more session about "
            f"×/÷ {by_session:.2f}"
        )
        known = [key for key in RESPONSES if key in self.quantities]
        also = [f"{key} {self._reach(self.quantities[key], ', after one step')}" for key in known]
        return [
            f"rig     {counted(n, 'session')}: the next one's {self.symbol} within "
            f"{self._reach(one, f'; after one reference step ({self.best_step})')}, at the worst level",
            *([f"also    {'; '.join(also)}"] if also else []),
            f"scatter gain {one.sd.gain:.3g}, tilt {one.sd.tilt:.3g}, session × level {one.sd.level:.3g} (sd of ln "
            f"{self.symbol}); one run {one.sd_step:.3g}",
            *([] if self.confounded else [more]),
            f"advice  {self.advice}",
        ]

    def _reach(self, one: Quantity, after: str) -> str:
        return f"×/÷ {one.factor:.2f}" + ("" if self.confounded else f"{after} ×/÷ {one.with_step:.2f}")

    def summary(self) -> str:
        """The next session's reach, the scatter, the advice, and the gravest findings."""
        return "\n".join([*self.lines(), *sentences(self.findings[:3])])

    def to_frame(self) -> "pandas.DataFrame":
        """One row a value: quantity, session, level, value, sd_log, dof."""
        every = [(name, one) for name, of in self.quantities.items() for one in of.values]
        return pandas.DataFrame([{"quantity": name, **msgspec.structs.asdict(one)} for name, one in every])


def rig_of_fits(fits: Mapping[str, Fit], options: SessionsOptions) -> Rig:
    """A rig of three fits and more, in their order; DataError where they do not belong together."""
    if len(fits) < LEAST_SESSIONS:
        raise DataError(
            f"{counted(len(fits), 'session')}: three and more tell what the next one may be; record another, or see "
            "what moved between two with eaid compare"
        )
    if foretold := [name for name, fit in fits.items() if fit.of_sessions]:
        raise DataError(
            f"{foretold[0]}: is foreseen by reference steps, no session of its own; fit the logs of its session"
        )
    told = gather.told_together(fits)
    sound = [fit for fit in fits.values() if fit.verdict.usable] or list(fits.values())
    base = max(reversed(sound), key=lambda fit: (fit.nonlinear is not None, len(fit.data.levels)))
    others = ((name, fit) for name, fit in fits.items() if fit is not base)
    told += [one for name, fit in others for one in gather.plant_moved(f"session {name}", fit, base)]
    seconds = dict.fromkeys(("tau1", "tau2", "dead_time_s"), "s")
    units = {**seconds, "a0": "1/s", "omega": "rad/s", **dict.fromkeys(("Ts", *RESPONSES), base.data.output_unit)}
    found = {}
    for name in SESSION_NUMBERS:
        of_runs = gather.run_scatter([fit for fit in fits.values() if not gather.of_single_runs(fit)], name)
        each = [one for key, fit in fits.items() for one in gather.values_of_session(fit, name, key, of_runs)]
        values = gather.snapped(each)
        without = [key for key in fits if key not in {one.session for one in values}]
        if len(fits) - len(without) >= LEAST_SESSIONS:
            sd_step = gather.run_scatter(fits.values(), name)
            apart = name not in gather.PARTS or not all(map(gather.of_single_runs, fits.values()))
            one = quantity_of(values, list(fits), options, sd_step, units.get(name, ""), apart)
            if name == "Ts" or one[0].factor < FACTOR:
                found[name] = one
        elif name == "Ts":
            raise DataError(f"{', '.join(without)}: {gather.NO_INTERVAL}")
    sessions = tuple(Session(name, gather.logs_of(fit)) for name, fit in fits.items())
    slim = msgspec.structs.replace(base, steps=(), responses=(), parameters=(), recorded=None, findings=())
    return _judged_rig(found, options=options, input_unit=base.data.input_unit, sessions=sessions, base=slim,
                   findings=tuple(told))  # fmt: skip


def rig_of_table(values: Sequence[SessionValue], options: SessionsOptions) -> Rig:
    """A rig of a plain table."""
    if len(names := list(dict.fromkeys(one.session for one in values))) < LEAST_SESSIONS:
        raise DataError(f"the table holds {counted(len(names), 'session')}; three and more tell what the next may be")
    found = {"value": quantity_of(gather.snapped(values), names, options)}
    return _judged_rig(found, options=options, sessions=tuple(map(Session, names)))


def quantity_of(
    values: Sequence[SessionValue], names: Sequence[str], options: SessionsOptions, sd_step: float | None = None,
    unit: str = "", apart: bool = True,
) -> tuple[Quantity, SessionModel]:  # fmt: skip
    """One number over the sessions, the next one foreseen; and its model. `apart`: whether something tells runs from
    sessions at a level; else a step's own scatter is taken as half of what both show, or more."""
    levels = np.unique([one.level for one in values])
    each = [{one.level for one in values if one.session == name} for name in names]
    terms = min(options.terms or 3, len(levels), max(1, len(values) - 2))
    if options.terms is None and len(levels) > 1 and all(one == set(levels) for one in each if one):
        terms = 0
    middle = float(levels[len(levels) // 2])
    sd = median([one.sd_log for one in values]) if sd_step is None else sd_step
    model = SessionModel(_as_known(values, names), options.reference_level or middle, terms, np.zeros(3)).likeliest()[0]
    if options.reference_level is None and model.count >= MANY_SESSIONS:
        model = model.placed()
    sd = sd if apart else max(sd, math.sqrt(float(model.variances[2]) / 2))
    now, (best, after) = model.next(model.knots), model.worth_most(sd)
    finer = replace(model, known=replace(model.known, W=0.75 * model.known.W)).next(model.knots)
    rows = np.column_stack([now.level, now.value, *now.ends, now.dof, np.exp(now.reach), np.exp(after.reach)])
    scatter, more = SessionScatter(*np.sqrt(model.variances).tolist()), float(np.exp(finer.reach.max()))
    foreseen = tuple(Foreseen(*row) for row in rows.tolist())
    return Quantity(unit, model.reference, terms, tuple(values), scatter, sd, best, more, foreseen), model


def _as_known(values: Sequence[SessionValue], names: Sequence[str]) -> KnownValues:
    """Values as the model takes them; DataError where one is of another session than these."""
    if strange := {one.session for one in values}.difference(names):
        raise DataError(f"a value of the rig is of {min(strange)}, which is none of its sessions; make it again")
    return as_known((names.index(one.session), one.level, one.value, one.sd_log) for one in values)


def _judged_rig(found: Mapping[str, tuple[Quantity, SessionModel]], **parts: Any) -> Rig:
    """The rig, with what is to be known of its main quantity; UsageError for more terms than that carries."""
    rig = Rig(quantities={name: one for name, (one, _) in found.items()}, **parts)
    (one, model), wanted = next(iter(found.values())), rig.options.terms
    if one.terms and wanted not in (None, one.terms):
        held = f"{counted(len(model.known.y), 'value')} at {counted(len(model.knots), 'level')}"
        raise UsageError(f"«terms» {wanted}: the sessions hold {held}; give {one.terms} at most")
    return msgspec.structs.replace(rig, findings=ranked([*rig.findings, *_rig_findings(rig, one, model)]))


def _rig_findings(rig: Rig, one: Quantity, model: SessionModel) -> Iterator[Finding]:
    unit, tell = rig.input_unit, partial(finding, subject="sessions")
    name = next(iter(rig.quantities))
    if model.count < FEW_SESSIONS:
        yield tell("few-sessions", sessions=model.count)
    none = tuple(COMPONENTS[k] for k in model.free if model.variances[k] <= 1e-6 * model.line.scale)
    if none:
        yield tell("no-scatter-in-parts", parameter=name, components=none)
    if not model.knots[0] <= one.reference_level <= model.knots[-1]:
        yield tell("reference-level-outside", levels=model.knots, level=one.reference_level, unit=unit)
    far, factor = _carried(model)
    if math.log(factor) < CARRIES * math.log(one.factor):
        session = rig.names[far]
        yield tell("session-carries-estimate", session=session, parameter=name, factor=factor, whole=one.factor)
    slope, p = model.trend()
    if p < TREND_CHANCE:
        yield tell("trend-over-sessions", parameter=name, pct=100 * math.expm1(slope), p=p)
    if model.parts.any():
        apart = model.knots[model.parts == np.bincount(model.parts).argmin()]
        yield tell("levels-and-sessions-confounded", levels=apart, unit=unit)


def _carried(model: SessionModel) -> tuple[int, float]:
    """The session that lies furthest off, and by what factor the next one's interval reaches without it; infinite where
    the others do not tell."""
    line, of = model.line, model.known
    off = np.where(of.session == np.arange(of.session.max() + 1)[:, None], line.residuals, 0.0)
    far = int(np.argmax(np.einsum("sn,nm,sm->s", off, line.inverse, off)))
    kept = of.session != far
    rest = replace(model, known=KnownValues(*(one[kept] for one in (of.session, of.level, of.y, of.W))))
    enough = len(rest.known.y) > line.values.X.shape[1] and len(rest.knots) == len(model.knots)
    if model.count <= LEAST_SESSIONS or not enough:
        return far, math.inf
    return far, float(np.exp(rest.likeliest()[0].next(model.knots).reach.max()))
