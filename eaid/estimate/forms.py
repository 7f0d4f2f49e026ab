"""T_s(u), τ1(u), τ2(u) as forms that are linear in their coefficients, the models that they make with C, and their
constraints.

    nonlinear      T_s cubic, τ1 and τ2 quadratic, Eqs. (5)–(7); the degrees fall where the levels are too few
    levels first   τ1 and τ2 the same, T_s solved for at each level
    linear         T_s = (b0 u + c0)/a0, τ1 = 1/a0, C = 1, Eq. (8)
    friction       T_s, τ1, τ2 of each level, Eq. (3)

Below the lowest identified input, u_low, τ1 and τ2 keep their edge value and T_s goes linearly to 0 at rest; above the
highest, all keep their edge value. Constraints, specification 3: τ1 ≥ 1 ms, τ2 ≥ τ1, T_s ≥ 0, 0 ≤ C ≤ 1.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from eaid.arrays import Array, read_only
from eaid.plant.drive import Tables
from eaid.plant.dynamics import CHECKED_INPUTS, TAU_FLOOR_S, Plant
from eaid.plant.forms import Form, LegendreForm, PerLevel, Proportional, Sides

RECORDS = 1e6  # τ2 is looked for up to this many record lengths: no data can tell it from endless
# τ2 is looked for up to this many record lengths where C is free: T_s then grows with τ2, all but straight
RECORDS_FREE = 100.0
PAPER_DEGREES = (3, 2, 2)  # Degrees of T_s, τ1, τ2
# A τ is kept off zero by this much [s]: between the 101 duties a quadratic may dip below its floor
LEAST_TAU_S = 0.1 * TAU_FLOOR_S
# Of one lag, series and ringing: a lag under half a sample imitates what happens between samples, one beyond so many
# records is none
FASTEST_TAU, SLOWEST_TAU = 0.5, 100.0
LEAST_ZETA, MOST_ZETA = 0.005, 30.0
MOST_ZERO = 20.0
MOST_C = 3.0  # Beyond, two nearly equal parts of opposite sign imitate other shapes


class Constraints(NamedTuple):
    """A x ≥ b, and for each row the code of its constraint and the input at which it holds (NaN: everywhere)."""

    A: Array
    b: Array
    codes: tuple[str, ...]
    inputs: Array

    def active(self, rows: Iterable[int]) -> dict[str, tuple[float, ...]]:
        """Active constraints by code, and the inputs at which each holds."""
        held: dict[str, list[float]] = {}
        for i in rows:
            held.setdefault(self.codes[i], []).extend([float(self.inputs[i])] * bool(np.isfinite(self.inputs[i])))
        return {code: tuple(at) for code, at in held.items()}


class Rows(NamedTuple):
    """Linear maps from the coefficients to T_s, τ1, τ2 of some inputs, and how far from rest these are (at most 1)."""

    rest: Array
    steady: Array
    tau1: Array
    tau2: Array


@dataclass(frozen=True, eq=False)
class Model:
    """Forms of T_s, τ1, τ2 over a range of inputs, and C. The unknowns x are their coefficients, a free C last."""

    Ts: Form | None  # None: solved for at each level, no unknown
    tau1: Form
    tau2: Form | None  # None: there is but one time constant
    share: float | None  # C; None: an unknown
    low: float
    high: float
    limited: Array  # Inputs at which the constraints hold
    # parallel | pair | lag | swing: two lags in parallel, of them also an overshoot, one, or two in series and ringing:
    # 1/ω and ζ as τ1 and τ2, z as C
    kind: str = "parallel"
    least_s: float = LEAST_TAU_S  # What τ is kept above where it is evaluated [s]
    signed: bool = False  # Whether the input goes below rest, too

    @property
    def free_share(self) -> bool:
        """Whether C is an unknown."""
        return self.share is None

    @property
    def forms(self) -> tuple[Form | None, Form, Form | None]:
        """Of T_s, τ1, τ2."""
        return self.Ts, self.tau1, self.tau2

    @cached_property
    def slices(self) -> tuple[slice, slice, slice]:
        """Where the coefficients of T_s, τ1, τ2 lie in x."""
        ends = np.cumsum([0, *(0 if form is None else form.size for form in self.forms)]).tolist()
        return slice(ends[0], ends[1]), slice(ends[1], ends[2]), slice(ends[2], ends[3])

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return int(self.slices[2].stop) + self.free_share

    def rows(self, u: Array) -> Array:
        """∂(T_s, τ1, τ2, C)/∂x at some inputs, (4, m, n); what is no unknown has a row of zeros."""
        M = np.zeros((4, len(u), self.size))
        for k, (form, part) in enumerate(zip(self.forms, self.slices, strict=True)):
            if form is not None:
                M[k, :, part] = form.rows(u)
        if self.free_share:
            M[3, :, -1] = 1.0
        return M

    def theta(self, x: Array, M: Array) -> Array:
        """T_s, τ1, τ2, C at the inputs whose rows are M, (4, m)."""
        theta = M @ x
        if self.tau2 is None:
            theta[2] = 1.0  # which nothing feels
        theta[3] = np.clip(theta[3], 0.0, 1.0) if self.share is None else self.share
        np.maximum(theta[1:3], LEAST_TAU_S, out=theta[1:3])
        return theta

    @lru_cache(maxsize=16)  # noqa: B019 - a fit asks for them at each of its weights
    def limits(self, longest_s: float, shortest_s: float = 0.0) -> Constraints:
        """The constraints; times are the longest record and the shortest between two samples [s]."""
        Ts, tau1, tau2, C = self.rows(self.limited)
        parts: list[tuple[str, Array, float]] = [
            ("tau-fastest", tau1, FASTEST_TAU * shortest_s), ("tau-slowest", -tau1, -SLOWEST_TAU * longest_s),
        ]  # fmt: skip
        share = [("C-zero", C[:1], 0.0), ("C-one", -C[:1], -1.0)]
        if self.kind == "swing":
            parts += [("zeta-least", tau2[:1], LEAST_ZETA), ("zeta-most", -tau2[:1], -MOST_ZETA)]
            share = [("zero-least", C[:1], -MOST_ZERO), ("zero-most", -C[:1], -MOST_ZERO)]
        elif self.kind == "pair":
            parts = [parts[0], ("tau2-meets-tau1", tau2 - tau1, 0.0), ("tau-slowest", -tau2, -SLOWEST_TAU * longest_s)]
            share = [("C-zero", C[:1], 0.0), ("C-most", -C[:1], -MOST_C)]
        elif self.kind == "parallel" and self.tau2 is None:
            parts = [("a0-fastest", tau1[:1], 0.01 * shortest_s), ("a0-slowest", -tau1[:1], -1e3 * longest_s)]
        elif self.kind == "parallel":
            parts = [("tau1-floor", tau1, TAU_FLOOR_S), ("tau2-meets-tau1", tau2 - tau1, 0.0)]
            parts += [("Ts-zero", Ts, 0.0)] * (self.Ts is not None)
            parts.append(("tau2-endless", -tau2, -(RECORDS_FREE if self.free_share else RECORDS) * longest_s))
        parts += share * self.free_share
        A = np.concatenate([part for _, part, _ in parts])
        b = np.concatenate([np.full(len(part), least) for _, part, least in parts])
        at = [self.limited if len(part) == len(self.limited) else np.full(len(part), np.nan) for _, part, _ in parts]
        codes = tuple(code for code, part, _ in parts for _ in part)
        return Constraints(read_only(A), read_only(b), codes, np.concatenate(at))

    def parameters(self, x: Array) -> Plant:
        """Polynomials in powers of the duty, lowest first, padded with zeros to the paper's degrees."""
        parts: list[tuple[float, ...]] = []
        below: tuple[float, ...] = ()
        for form, part, degree in zip(self.forms, self.slices, PAPER_DEGREES, strict=True):
            c = x[part]
            if isinstance(form, PerLevel):  # T_s of levels by themselves: the polynomial beside their values
                plain = LegendreForm(min(degree, form.size - 1), self.low, self.high)
                powers = plain.powers(np.linalg.pinv(plain.rows(form.inputs)) @ c)
            elif isinstance(form, Sides):
                below = tuple(form.down.powers(c[form.up.size :]).tolist())
                powers = form.up.powers(c[: form.up.size])
            else:
                assert form is None or isinstance(form, LegendreForm | Proportional)
                powers = np.zeros(0) if form is None else form.powers(c)
            parts.append(tuple(np.pad(powers, (0, degree + 1 - len(powers))).tolist()))
        (Ts, tau1, tau2), share = parts, float(x[-1]) if self.share is None else self.share
        own = self.Ts.points(x[self.slices[0]]) if isinstance(self.Ts, PerLevel) else ()
        if self.kind == "parallel":
            return Plant(tau1, tau2, Ts, (self.low, self.high), share, Ts_through=own)
        if self.kind == "pair":
            one, two = (tau[: self.tau1.size] for tau in (tau1, tau2))
            return Plant(one, two, Ts, (self.low, self.high), share, Ts_through=own, floor_s=self.least_s)
        swings = self.kind == "swing"
        if self.signed and not below:  # one gain for both sides
            below = (0.0, -Ts[1])
        tau1 = tau1[: self.tau1.size]
        if swings and self.free_share and tau2[0] > 1 and 0 < (C := in_parallel(tau2[0], share)[2]) < MOST_C:
            one, two = (tuple(part * c for c in tau1) for part in in_parallel(tau2[0], share)[:2])
            return Plant(one, two, Ts, (self.low, self.high), C, Ts_below=below, Ts_through=own, floor_s=self.least_s)
        return Plant(
            tau1, tau1, Ts, (self.low, self.high), 1.0, zeta=tau2[0] if swings else None,
            zero=share if swings else 0.0, Ts_below=below, Ts_through=own, floor_s=self.least_s,
        )  # fmt: skip

    def unknowns(self, p: Plant) -> Array:
        """x of a model in powers of the duty, by its values at as many inputs as it has coefficients."""
        x = np.full(self.size, p.C)
        for k, (form, part) in enumerate(zip(self.forms, self.slices, strict=True)):
            if form is not None:
                values = p.steady(form.inputs), *p.time_constants(form.inputs)
                x[part] = np.linalg.solve(form.rows(form.inputs), values[k])
        return x

    def rows_of(self, u: Array, paces: Array | None = None) -> Rows:
        """Rows for any inputs, those beyond the range included; τ1, τ2 at other ones where `paces` says so."""
        size, paced = (np.abs(one) if self.signed else one for one in (u, u if paces is None else paces))
        rest = np.clip(size / self.low, 0.0, 1.0) if self.low > 0 else np.ones_like(u)
        inside, paced = (np.clip(one, self.low, self.high) for one in (size, paced))
        steady_at = np.copysign(inside, u) if self.signed else inside
        parts = (
            np.zeros((len(u), 0)) if form is None else np.ascontiguousarray(form.rows(at))
            for form, at in zip(self.forms, (steady_at, paced, paced), strict=True)
        )
        steady, tau1, tau2 = parts
        return Rows(rest, np.ascontiguousarray(steady * rest[:, None]), tau1, tau2)

    def tables(self, rows: Rows, x: Array) -> Tables:
        """T_s, τ1, τ2 at the inputs behind `rows`."""
        Ts, one, two = self.slices
        tau1, by_tau1 = _floored(rows.tau1, x[one], self.least_s)
        tau2, by_tau2 = _floored(rows.tau2, x[two], self.least_s)
        return Tables(rows.steady @ x[Ts], tau1, tau2, rows.rest, rows.steady, by_tau1, by_tau2)


def in_parallel(zeta: float, z: float) -> tuple[float, float, float]:
    """τ1 and τ2, both in 1/ω, and C of two lags in parallel that are two real lags with a zero:
    C = (z/ω − τ1)/(τ2 − τ1)."""
    apart = float(zeta + np.sqrt(zeta**2 - 1))
    return 1 / apart, apart, (z - 1 / apart) / (apart - 1 / apart)


def _floored(rows: Array, x: Array, least_s: float) -> tuple[Array, Array]:
    """τ and its derivatives; 1 s, which no state feels, where a model has no such τ."""
    if rows.shape[1] == 0:
        return np.ones(len(rows)), rows
    tau = rows @ x
    low = tau < least_s
    return (np.where(low, least_s, tau), np.where(low[:, None], 0.0, rows)) if low.any() else (tau, rows)


def nonlinear(levels: Array, share: float | None) -> Model:
    """Eqs. (4)–(7) over the range of some levels: a polynomial has at most as many coefficients as there are."""
    low, high, most = float(levels.min()), float(levels.max()), len(np.unique(levels)) - 1
    Ts, tau1, tau2 = (LegendreForm(min(degree, most), low, high) for degree in PAPER_DEGREES)
    return Model(Ts, tau1, tau2, share, low, high, np.linspace(low, high, CHECKED_INPUTS if high > low else 1))


def of_kind(
    kind: str, gain: Form, low: float, high: float, shortest_s: float, zero: float | None = 0.0, signed: bool = False,
    pace: int = 0,
) -> Model:  # fmt: skip
    """One lag, or two in series and ringing; `zero` is z, None: an unknown. Their time constants go together with the
    input as a polynomial of the degree `pace`."""
    lag, limited = kind == "lag", np.linspace(low, high, CHECKED_INPUTS) if pace else np.array([high])
    return Model(
        gain, LegendreForm(pace, low, high), None if lag else LegendreForm(0, low, high), 1.0 if lag else zero, low,
        high, limited, kind, min(TAU_FLOOR_S, 0.1 * shortest_s), signed,
    )  # fmt: skip


def linear(levels: Array) -> Model:
    """Eq. (8) over the range of some levels; with a single one c0 is 0."""
    low, high = float(levels.min()), float(levels.max())
    return Model(LegendreForm(int(high > low), low, high), LegendreForm(0, low, high), None, 1.0, low, high, levels[:1])


def friction(levels: Array, share: float | None) -> Model:
    """Eq. (3) with T_s, τ1, τ2 of every level."""
    each = PerLevel(tuple(levels.tolist()))
    return Model(each, each, each, share, float(levels[0]), float(levels[-1]), levels)
