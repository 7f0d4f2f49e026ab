"""The plant in fit.json: its numbers, intervals, and the kinds of lag that were tried."""

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec

from eaid.plant.dynamics import TAU_FLOOR_S, Plant
from eaid.plant.forms import refuse_unordered
from eaid.results.common import Interval, Number, Positive, Result
from eaid.results.recorded import KindTried

if TYPE_CHECKING:
    from eaid.results.models import FrictionLevel, Release

LAGS = ("tau1", "tau2", "omega")  # What may go with the input
Polynomial = Annotated[tuple[Number, ...], msgspec.Meta(min_length=1)]


class PlantIntervals(Result, frozen=True):
    """95 % intervals of what the plant has beside its curves."""

    gain: Interval = None
    """T_s over the input, at the highest."""
    levels: dict[str, tuple[tuple[Number, Number, Number], ...]] = {}
    """By name inputs, and the ends there: T_s of levels that were held, τ1, τ2 and ω where they go with the input."""
    gain_below: Interval = None
    """The same below rest."""
    tau1: Interval = None
    """Of the lags, at the highest input where they go with it; of `series` of the two, not of 1/ω."""
    tau2: Interval = None
    C: Interval = None
    omega: Interval = None
    """ω = 1/τ1 of `ringing` [rad/s]."""
    zeta: Interval = None
    dead_time_s: Interval = None


class FittedPlant(Result, frozen=True):
    """The one plant that every later command reads; inputs and outputs in the rig's units, counted from rest."""

    kind: Literal["lag", "parallel", "overshoot", "series", "ringing"]
    Ts: Polynomial
    """T_s(u) of inputs above rest, in powers of the input's size, lowest first."""
    u_range: tuple[Annotated[float, msgspec.Meta(ge=0, le=1e60)], Positive]
    """Least and largest identified input, by size."""
    tau1: Polynomial
    """τ1(u) [s], of `lag` the only time constant; of `series` and `ringing` 1/ω."""
    tau2: tuple[Number, ...] = ()
    """τ2(u) [s], of the kinds that have two in parallel."""
    C: Number = 0.85
    """Share of the fast part: 1 of `lag`, above 1 of `overshoot`."""
    zeta: Number | None = None
    """Damping of `series` (1 and above) and `ringing`."""
    zero: Number = 0.0
    """z of those: y = x + z x'/ω."""
    Ts_below: tuple[Number, ...] = ()
    """T_s of inputs below rest; empty: the input has one sign."""
    Ts_through: tuple[tuple[Number, Number], ...] = ()
    """Inputs and values that T_s(u) goes through in place of `Ts` (`--curve levels`); empty: it is the polynomial."""
    Ts_levels: tuple[tuple[Number, Number], ...] = ()
    """Of another kind than the clutch's the levels, and T_s of each, its own about the curve; empty: the curve's."""
    dead_time_s: Annotated[float, msgspec.Meta(ge=0, le=1e60)] = 0.0
    idle: Number = 0.0
    """Output at rest."""
    release: tuple[Positive, Positive] | None = None
    """τ1, τ2 of falls to rest [s], where they have their own."""
    release_as_left: bool = False
    """Falls of a held input to rest have those of the input that was left; `release` is theirs in the middle."""
    falls_as_release: bool = False
    """Falls between levels have them too."""
    falls: tuple[Positive, Positive] = (1.0, 1.0)
    """Factors on τ1 and τ2 of falls between levels."""
    excess: Number = 0.0
    """Share by which T_s is larger where a held input was fallen to."""
    floor_s: Number = TAU_FLOOR_S
    """Least time constant [s]."""
    input_unit: str = "%"
    output_unit: str = "N·m"
    ci95: PlantIntervals | None = None
    tried: tuple[KindTried, ...] = ()
    """The kinds of lag that were tried, the one taken first; none of a closed loop, nor of most steps."""

    def __post_init__(self) -> None:
        refuse_unordered(self.Ts_through)

    @property
    def another(self) -> bool:
        """Whether evidence asked for another kind than the clutch's two lags over the input."""
        return bool(self.tried) and self.tried[0].kind != "clutch"

    @property
    def paced(self) -> bool:
        """Whether its time constants go with the input."""
        return any(self.tau1[1:])

    @property
    def numbers(self) -> dict[str, tuple[float, Interval]]:
        """What it is known by, by the names of `ci95`, each with its interval: gain and time constants at the highest
        input."""
        p, top = self.plant, self.u_range[1]
        names = ("gain", *("gain_below",) * p.signed, *names_of(p))
        return {name: (number_at(p, name, top), getattr(self.ci95, name, None)) for name in names}

    def value(self, name: str, u: float) -> float:
        """What the plant is known by at an input: T_s of a level its own."""
        own = (Ts for level, Ts in self.Ts_levels if name == "Ts" and math.isclose(level, u))
        return next(own, number_at(self.plant, name, u))

    def at(self, u: float) -> dict[str, tuple[float, Interval]]:
        """T_s and what the plant is known by at an input, each with its interval."""
        names = ("Ts", *names_of(self.plant))
        return {name: (value := self.value(name, u), self._ends(name, u, value)) for name in names}

    def _ends(self, key: str, u: float, value: float) -> Interval:
        """The interval of a value at an input: where it goes with the input no narrower than at those to both sides."""
        below = key == "Ts" and u < 0  # the levels told are those above rest
        rows = [] if self.ci95 is None or below else sorted(self.ci95.levels.get(key, ()))
        if not rows:
            if key != "Ts":
                return None if key in LAGS and self.paced else getattr(self.ci95, key, None)
            gain = getattr(self.ci95, "gain_below" if below and self.Ts_below else "gain", None)
            straight = bool(self.tried) and self.tried[0].gain in ("one", "sides")
            ends = sorted(u * end for end in gain) if straight and gain is not None else None
            return None if ends is None else (ends[0], ends[1])
        at = [row for row in rows if math.isclose(row[0], u)]
        place = bisect_left(rows, (u,))
        rows = at or rows[max(place - 1, 0) : place + 1]
        beside = [(self.value(key, near), low, high) for near, low, high in rows]
        if value <= 0 or any(own <= 0 for own, *_ in beside):
            return None
        return value * min(low / own for own, low, _ in beside), value * max(high / own for own, _, high in beside)

    @classmethod
    def of(cls, p: Plant, units: tuple[str, str], ci95: PlantIntervals | None = None) -> "FittedPlant":
        """A plant as the file holds it; `units` of input and output."""
        shared = {one.name: getattr(p, one.name) for one in fields(p)}
        return cls(p.kind, input_unit=units[0], output_unit=units[1], ci95=ci95, **shared)  # type: ignore[arg-type]

    @property
    def plant(self) -> Plant:
        """The plant itself."""
        held = {one.name: getattr(self, one.name) for one in fields(Plant)}
        return Plant(**held | {"tau2": self.tau2 or self.tau1})


def names_of(p: Plant) -> tuple[str, ...]:
    """What a plant is known by beside its gain, by the names of `PlantIntervals`."""
    lags = {"lag": ("tau1",), "ringing": ("omega", "zeta"), "series": ("tau1", "tau2")}
    return (*lags.get(p.kind, ("tau1", "tau2", "C")), *("dead_time_s",) * bool(p.dead_time_s))


def number_at(p: Plant, name: str, u: float) -> float:
    """What a plant is known by at an input, or at that below rest."""
    if name in ("Ts", "gain", "gain_below"):
        at = -u if name == "gain_below" else u
        return float(p.curve(at)) / (1.0 if name == "Ts" else at)
    if name in LAGS:
        tau1, tau2 = map(float, p.time_constants(u))
        return {"tau1": tau1, "tau2": tau2, "omega": 1 / tau1}[name]
    return float(getattr(p, name))


def falls_between(levels: "Sequence[FrictionLevel]") -> "tuple[FrictionLevel, ...]":
    """Of fitted steps those that fall from one level to another, not to rest."""
    return tuple(row for row in levels if row.from_ > row.level > 0)


def with_release(plant: Plant, release: "Release | None", levels: "Sequence[FrictionLevel]" = ()) -> Plant:
    """A plant with the release constants, where falls to rest were fitted.

    Recorded falls between levels get them too where they are nearer the release than the rise, in log τ1 + log τ2.
    """
    if release is None:
        return plant
    constants = (release.tau1, release.tau2)
    model = replace(plant, release=constants, release_as_left=release.as_left)
    nearer = 0.0
    for row in falls_between(levels):
        for tau, up, down in zip((row.tau1, row.tau2), model.time_constants(row.level), constants, strict=True):
            nearer += abs(math.log(tau / max(float(up), TAU_FLOOR_S))) - abs(math.log(tau / down))
    return replace(model, falls_as_release=nearer > 0)
