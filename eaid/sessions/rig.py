"""`sessions`: fits of several mountings of one rig, or a plain table → what the next one may be, rig.json."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import msgspec
import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.special import stdtrit

from eaid.arrays import Array
from eaid.errors import DataError, UsageError
from eaid.findings import Finding, finding, ranked, sentences
from eaid.findings.row import SYMBOLS
from eaid.options import SessionsOptions
from eaid.results import codec
from eaid.results.common import Inputs, Made, Number, Positive, Result
from eaid.results.fit import Fit
from eaid.sessions.gather import LEAST, Session, Value, run_scatter, session_of, snapped, together, values_of
from eaid.sessions.model import NOTHING, Known, Model, Next, steps_known
from eaid.shown import Plotted, counted

if TYPE_CHECKING:
    import pandas

FEW = 5  # Sessions below which their scatter is known to a factor only
CARRIES = 0.5  # Part of its width that the next session's interval keeps where one session carried it
CHANCE = 0.05


class Scatter(Result, frozen=True):
    """Standard deviations of ln θ over the sessions: gain, tilt over ln level, session at a level."""

    gain: Number = 0.0
    tilt: Number = 0.0
    level: Number = 0.0


class Foreseen(Result, frozen=True):
    """The next session at one level, with its 95 % interval; `with_step` where one reference step is known: by what
    factor the interval then reaches up and down."""

    level: Positive
    value: Number
    low: Number
    high: Number
    dof: Number
    factor: Number
    with_step: Number


class Quantity(Result, frozen=True):
    """One number of the rig over its sessions."""

    unit: str
    reference_level: Positive
    terms: int
    """Of the common line in ln level; 0: one a level."""
    values: tuple[Value, ...]
    sd: Scatter
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

    def known(self, names: Sequence[str]) -> Known:
        """Its values as the model takes them."""
        session = np.array([names.index(one.session) for one in self.values], dtype=np.float64)
        level, value, sd = np.array([(one.level, one.value, one.sd_log) for one in self.values]).T
        return Known(session, level, np.log(value), sd**2)

    def model(self, names: Sequence[str]) -> Model:
        """Its model, with the variances that were found."""
        v = np.square([self.sd.gain, self.sd.tilt, self.sd.level])
        return Model(self.known(names), self.reference_level, self.terms, v)


class Rig(Plotted, codec.Saved, Made, frozen=True):
    """A rig over its sessions: what they have in common, how they differ, what the next one may be."""

    FILE: ClassVar[str] = "rig"
    inputs: Inputs = {}
    options: SessionsOptions = SessionsOptions()
    input_unit: str = ""
    sessions: tuple[Session, ...] = ()
    quantities: dict[str, Quantity] = {}
    """The main one first: Ts, then tau1, tau2, B, a0 where the sessions know them; of a plain table `value`."""
    base: Fit | None = None
    """The fit of the session with the most levels, from which that of today is made; None: a plain table."""

    @property
    def names(self) -> tuple[str, ...]:
        """The sessions in order."""
        return tuple(one.name for one in self.sessions)

    @property
    def main(self) -> Quantity:
        """The first of the quantities."""
        return next(iter(self.quantities.values()))

    @property
    def symbol(self) -> str:
        """How it is written."""
        name = next(iter(self.quantities))
        return SYMBOLS.get(name, name)

    def model(self, name: str = "") -> Model:
        """The model of a quantity, of the main one where none is named."""
        return (self.quantities[name] if name else self.main).model(self.names)

    def foreseen(self, name: str, levels: Array, steps: Known = NOTHING) -> Next:
        """The next session's values at some levels."""
        return self.model(name).next(levels, steps)

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
        """
        import pandas as pd

        if quantity and quantity not in self.quantities:
            raise UsageError(f"«quantity» {quantity}: the sessions know {', '.join(self.quantities)}")
        of, known = self.quantities[quantity] if quantity else self.main, NOTHING
        if steps is not None:
            from eaid.sessions.gather import table_values

            given = steps.assign(session="today", **({} if "sd_log" in steps else {"sd_log": of.sd_step}))
            rows = table_values(given)
            known = steps_known(*([getattr(one, key) for one in rows] for key in ("level", "value", "sd_log")))
        at = np.array([one.level for one in of.next] if levels is None else levels, dtype=np.float64)
        if not (at > 0).all():
            raise UsageError("«levels»: have to be above 0, as the model is one of logarithms")
        found = self.foreseen(quantity, at, known)
        columns = {"value": found.value, "low": found.ends[0], "high": found.ends[1], "dof": found.dof}
        return pd.DataFrame(columns, index=pd.Index(at, name="level"))

    def today(self, step: Any, **keywords: Any) -> Fit:
        """Reference steps of a new session → a fit with honest intervals for it: `eaid.today(rig, step)`."""
        from eaid.sessions.today import today

        return today(self, step, **keywords)

    def lines(self) -> list[str]:
        """What is known of the next session, and what to record."""
        one, unit = self.main, self.input_unit
        at = f"{one.best_level:.4g} {unit}".rstrip()
        n = len(self.sessions)
        wide = math.sqrt((1 + 1 / (n + 1)) / (1 + 1 / n)) * float(stdtrit(n, 0.975) / stdtrit(n - 1, 0.975))
        more = f"a fourth repeat for three leaves ×/÷ {one.more_repeats:.2f}, one more session about "
        more += f"×/÷ {one.factor**wide:.2f}"
        return [
            f"rig     {counted(len(self.sessions), 'session')}: the next one's {self.symbol} within ×/÷ "
            f"{one.factor:.2f}; after one reference step ({at}) ×/÷ {one.with_step:.2f}",
            f"scatter gain {one.sd.gain:.3g}, tilt {one.sd.tilt:.3g}, session × level {one.sd.level:.3g} (sd of ln "
            f"{self.symbol}); one run {one.sd_step:.3g}",
            f"advice  {'sessions, not repeats: ' if one.more_repeats > 0.95 * one.factor else ''}{more}",
            f"advice  in each new session first a reference step at {at}, which is worth most",
        ]

    def summary(self) -> str:
        """The next session's reach, the scatter, the advice, and the gravest findings."""
        return "\n".join([*self.lines(), *sentences(self.findings[:3])])

    def to_frame(self) -> "pandas.DataFrame":
        """One row a value: quantity, session, level, value, sd_log."""
        import pandas as pd

        rows = [
            {"quantity": name, **msgspec.structs.asdict(one)} for name, of in self.quantities.items() for one in of.values
        ]
        return pd.DataFrame(rows)


def rig_of_fits(fits: Mapping[str, Fit], options: SessionsOptions) -> Rig:
    """A rig of three fits and more, in their order; DataError where they do not belong together."""
    if len(fits) < LEAST:
        raise DataError(
            f"{counted(len(fits), 'session')}: three and more tell what the next one may be; record another, or see "
            "what moved between two with eaid compare"
        )
    together(fits)
    sessions = tuple(session_of(name, fit) for name, fit in fits.items())
    units = {"Ts": (base := _fullest(fits)).data.output_unit, "tau1": "s", "tau2": "s", "a0": "1/s"}
    quantities = {}
    for name in ("Ts", "tau1", "tau2", "B", "a0"):
        values = snapped([one for key, fit in fits.items() for one in values_of(fit, name, key)])
        if len({one.session for one in values}) < LEAST:
            if name == "Ts":
                without = [key for key in fits if key not in {one.session for one in values}]
                raise DataError(f"{', '.join(without)}: no level has a T_s with an interval; fit the logs again with «ci»")
            continue
        scatter = [one for fit in fits.values() if (one := run_scatter(fit, name)) is not None]
        sd = float(np.sqrt(np.mean(np.square(scatter)))) if scatter else None
        quantities[name] = quantity_of(values, list(fits), options, sd, units.get(name, ""))
    return _judged(Rig(options=options, input_unit=base.data.input_unit, sessions=sessions, quantities=quantities,
                       base=_slim(base)))  # fmt: skip


def rig_of_table(values: Sequence[Value], options: SessionsOptions, unit: str = "") -> Rig:
    """A rig of a plain table."""
    names = list(dict.fromkeys(one.session for one in values))
    if len(names) < LEAST:
        raise DataError(f"the table holds {counted(len(names), 'session')}; three and more tell what the next one may be")
    sessions = tuple(map(Session, names))
    return _judged(Rig(options=options, input_unit=unit, sessions=sessions,
                       quantities={"value": quantity_of(values, names, options)}))  # fmt: skip


def quantity_of(
    values: Sequence[Value], names: Sequence[str], options: SessionsOptions, sd_step: float | None = None, unit: str = ""
) -> Quantity:
    """One number over the sessions: its model found, the next session foreseen."""
    levels = np.unique([one.level for one in values])
    each = [{one.level for one in values if one.session == name} for name in names]
    shared = all(one == set(levels) for one in each if one)
    terms = min(3, len(levels), max(1, len(values) - 2))
    if options.terms is not None:
        terms = min(options.terms, terms)
    elif shared and len(levels) > 1:
        terms = 0
    middle = float(levels[len(levels) // 2])
    sd = float(np.median([one.sd_log for one in values])) if sd_step is None else sd_step
    plain = Quantity(unit, options.reference_level or middle, terms, tuple(values), Scatter(), sd, middle)
    model = Model(plain.known(names), plain.reference_level, terms)
    best, after = model.narrowest(sd)
    now = model.next(model.knots)
    finer = Known(model.known.session, model.known.level, model.known.y, 0.75 * model.known.W)
    more = Model(finer, model.reference, terms, model.variances).next(model.knots)
    rows = zip(now.level, now.value, *now.ends, now.dof, np.exp(now.reach), np.exp(after.reach), strict=True)
    return msgspec.structs.replace(
        plain, sd=Scatter(*np.sqrt(model.variances).tolist()), best_level=best,
        more_repeats=float(np.exp(more.reach.max())), next=tuple(Foreseen(*map(float, row)) for row in rows),
    )  # fmt: skip


def _fullest(fits: Mapping[str, Fit]) -> Fit:
    """The last fit of those with the most levels that has a model of its plant, if any has."""
    return max(
        reversed(list(fits.values())), key=lambda fit: (fit.plant_ is not None or fit.nonlinear is not None,
                                                        len(fit.data.levels)),
    )  # fmt: skip


def _slim(fit: Fit) -> Fit:
    """A fit without what only its own logs are described by."""
    return msgspec.structs.replace(fit, steps=(), parameters=(), recorded=None, findings=())


def _judged(rig: Rig) -> Rig:
    """The rig with what is to be known of it, by its main quantity; UsageError for more terms than that carries."""
    one, found, model = rig.main, list[Finding](), rig.model()
    if one.terms and rig.options.terms not in (None, one.terms):
        held = f"{counted(len(one.values), 'value')} at {counted(len(model.knots), 'level')}"
        raise UsageError(f"«terms» {rig.options.terms}: the sessions hold {held}; give {one.terms} at most")
    name, names, unit = next(iter(rig.quantities)), np.array(rig.names), rig.input_unit
    if model.count < FEW:
        found.append(finding("few-sessions", "sessions", sessions=model.count))
    none = [key for key, k in (("gain", 0), ("tilt", 1), ("session × level", 2)) if k in model.free
            and model.variances[k] <= 1e-6 * model.line.scale]  # fmt: skip
    if none:
        found.append(finding("no-scatter-between-sessions", "sessions", parameter=name, components=tuple(none)))
    if not model.knots[0] <= one.reference_level <= model.knots[-1]:
        found.append(finding("reference-level-outside", "sessions", model.knots, level=one.reference_level, unit=unit))
    found += _carried(model, names, name, one.factor)
    slope, p = model.trend()
    if p < CHANCE:
        pct = 100 * float(np.expm1(slope))
        found.append(finding("trend-over-sessions", "sessions", parameter=name, pct=pct, p=p))
    graph = (model.known.session[:, None] == model.known.session) | (model.known.level[:, None] == model.known.level)
    parts, label = connected_components(graph, directed=False)
    if parts > 1:
        apart = [np.unique(model.known.level[label == k]) for k in range(parts)]
        found.append(finding("levels-and-sessions-confounded", "sessions", min(apart, key=len), unit=unit, parts=parts))
    return msgspec.structs.replace(rig, findings=ranked(found))


def _carried(model: Model, names: Array, parameter: str, whole: float) -> list[Finding]:
    """The session that lies furthest off, refitted without it: where the next one's interval is then much narrower."""
    line, known = model.line, model.known
    off = known.y - line.values.X @ line.beta
    far = [float((part := off * (known.session == one)) @ line.inverse @ part) for one in range(len(names))]
    rest = known.without(float(np.argmax(far)))
    if model.count <= LEAST or len(rest.y) <= line.values.X.shape[1] or set(rest.level) != set(known.level):
        return []
    factor = float(np.exp(model.refitted(rest).next(model.knots).reach.max()))
    if np.log(factor) > CARRIES * np.log(whole):
        return []
    session = str(names[int(np.argmax(far))])
    return [finding("session-carries-estimate", "sessions", session=session, parameter=parameter, factor=factor, whole=whole)]
