"""The plant in fit.json: its numbers, intervals, and the kinds of lag that were tried."""

import math
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

Coefficients = Annotated[tuple[Number, ...], msgspec.Meta(min_length=1)]


class PlantIntervals(Result, frozen=True):
    """95 % intervals of what the plant has beside its curves."""

    gain: Interval = None
    """T_s over the input, at the highest."""
    Ts: tuple[tuple[Number, Number, Number], ...] = ()
    """Levels, and the ends of T_s at each; empty where the input moves."""
    gain_below: Interval = None
    """The same below rest."""
    tau1: Interval = None
    tau2: Interval = None
    C: Interval = None
    omega: Interval = None
    """ω = 1/τ1 of `ringing` [rad/s]."""
    zeta: Interval = None
    dead_time_s: Interval = None


class FittedPlant(Result, frozen=True):
    """The one plant that every later command reads; inputs and outputs in the rig's units, counted from rest."""

    kind: Literal["lag", "parallel", "overshoot", "series", "ringing"]
    Ts: Coefficients
    """T_s(u) of inputs above rest, in powers of the input's size, lowest first."""
    u_range: tuple[Annotated[float, msgspec.Meta(ge=0, le=1e60)], Positive]
    """Least and largest identified input, by size."""
    tau1: Coefficients
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
    dead_time_s: Annotated[float, msgspec.Meta(ge=0, le=1e60)] = 0.0
    idle: Number = 0.0
    """Output at rest."""
    release: tuple[Positive, Positive] | None = None
    """τ1, τ2 of falls to rest [s], where they have their own."""
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
    """The kinds of lag that were tried, the best first; none of a closed loop, which tells none, nor of most steps."""

    def __post_init__(self) -> None:
        refuse_unordered(self.Ts_through)

    @property
    def another(self) -> bool:
        """Whether evidence asked for another kind than the clutch's two lags over the input."""
        return bool(self.tried) and self.tried[0].kind != "clutch"

    @property
    def numbers(self) -> dict[str, tuple[float, Interval]]:
        """What it is known by, by the names of `ci95`, each with its interval: gain and time constants at the highest
        input."""
        p, top = self.plant, self.u_range[1]
        tau1, tau2 = (float(one) for one in p.time_constants(top))
        found = {"gain": float(p.steady(top)) / top}
        if p.signed:
            found["gain_below"] = float(p.steady(-top)) / -top
        if p.zeta is not None and p.kind == "ringing":
            found |= {"omega": 1 / tau1, "zeta": p.zeta}
        else:
            found |= {"tau1": tau1} | ({"tau2": tau2} if p.kind != "lag" else {})
            found |= {"C": p.C} if p.kind in ("parallel", "overshoot") else {}
        found |= {"dead_time_s": p.dead_time_s} if p.dead_time_s else {}
        return {key: (value, getattr(self.ci95, key, None)) for key, value in found.items()}

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
    model = replace(plant, release=constants)
    nearer = 0.0
    for row in falls_between(levels):
        for tau, up, down in zip((row.tau1, row.tau2), model.time_constants(row.level), constants, strict=True):
            nearer += abs(math.log(tau / max(float(up), TAU_FLOOR_S))) - abs(math.log(tau / down))
    return replace(model, falls_as_release=nearer > 0)
