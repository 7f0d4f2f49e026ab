"""Do falls go as rises do? Tested on the data, and fitted where they differ.

    rest     τ1, τ2 of falls to rest against those of the lowest identified input
    fall     factors on τ1, τ2 of falls between identified inputs against 1
    excess   T_s after a fall of a stepwise input, T_s (1 + h), against h = 0

Each is an unknown (or two) beside the coefficients; Wald's test with the covariance of the coloured residuals.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from eaid.arrays import Array
from eaid.estimate.from_logs import NOTHING, Solved, finished, with_extras
from eaid.estimate.log_intervals import Spread, spread
from eaid.estimate.response import Drive
from eaid.findings import Finding, finding
from eaid.results.recorded import FallTest

CHANCE = 1e-3  # A difference is taken over where chance makes one as large more rarely than this …
LEAST = {"rest": 0.1, "fall": 0.05, "excess": 0.003}  # … and it is larger than this part
# The numbers of each as results name them
NAMES = {"rest": ("release_tau1", "release_tau2"), "fall": ("fall_tau1", "fall_tau2"), "excess": ("hysteresis_pct",)}
WIDEST = 1e6  # Half-width beyond which there is no interval


@dataclass(frozen=True, eq=False)
class Tested:
    """The fit with what the tests asked for, and what they found."""

    solved: Solved
    falls: tuple[FallTest, ...]
    findings: tuple[Finding, ...]
    kept: tuple[str, ...] = ()  # Which of rest, fall and excess differ, and are fitted


def seen(drives: tuple[Drive, ...], low: float, stepwise: bool) -> tuple[str, ...]:
    """Which of the three the inputs can tell."""
    found = []
    if any(_falls_to_rest(drive) for drive in drives):
        found.append("rest")
    falls = [_level_falls(drive, low) for drive in drives]
    if stepwise and sum(falls) >= 2:
        found += ["fall", "excess"]
    return tuple(found)


def _falls_to_rest(drive: Drive) -> bool:
    level = drive.duty[drive.index]
    fell = np.flatnonzero((level[:-1] > 0) & (level[1:] == 0))
    return any(int((level[at + 1 :] == 0).argmin() or len(level) - at - 1) >= 8 for at in fell)


def _level_falls(drive: Drive, low: float) -> int:
    level = drive.duty[drive.index]
    return int(((level[1:] < level[:-1]) & (level[1:] >= low)).sum())


def tested(base: Solved, stepwise: bool) -> Tested:
    """Test all that the inputs can tell together, then fit again with those that differ."""
    names = seen(base.setup.drives, base.setup.model.low, stepwise)
    if not names:
        return Tested(base, (), (finding("release-not-seen", "release"),))
    whole = with_falls(base, names)
    uncertainty = spread(whole)
    judgements, left_in = _judged(whole, uncertainty, names)
    solved = base
    if left_in:
        solved = whole if left_in == names else with_falls(base, left_in)
        if left_in != names:
            judgements = {
                **_judged(solved, spread(solved), left_in)[0],
                **{k: v for k, v in judgements.items() if k not in left_in},
            }
    return Tested(solved, _as_result(judgements, left_in), _findings(solved, judgements, left_in), left_in)


@dataclass(frozen=True, eq=False)
class Judged:
    """Values of one extra, their half-widths, and the chance of a difference as large."""

    values: Array
    half: Array
    chance: float
    differs: bool


def edges(solved: Solved) -> Array:
    """τ1 and τ2 of the lowest identified input, (2,)."""
    tables = solved.curves(np.array([solved.setup.model.low]))
    return np.array([tables.tau1[0], tables.tau2[0]])


def as_rises(solved: Solved, name: str) -> Array:
    """Values of an extra with which falls go as rises do."""
    return edges(solved) if name == "rest" else np.array(NOTHING[name])


def with_falls(base: Solved, names: tuple[str, ...]) -> Solved:
    """The fit with some of rest, fall and excess as unknowns beside its own."""
    begin = np.concatenate([as_rises(base, name) for name in names])
    setup, x = with_extras(base.fitted, names, base.x, begin)
    return finished(setup, [x])


def _judged(solved: Solved, uncertainty: Spread, names: tuple[str, ...]) -> tuple[dict[str, Judged], tuple[str, ...]]:
    judgements, kept = {}, []
    model = solved.setup.model
    for name in names:
        at, count = solved.setup.at(name), len(NOTHING[name])
        G = np.zeros((count, solved.setup.size))
        G[:, at : at + count] = np.eye(count)
        values = solved.x[at : at + count]
        against = as_rises(solved, name)
        if name == "rest":  # the edge values are estimates too
            G -= solved.setup.slopes(np.array([model.low]))[1:, 0]
        off = values - against
        chance = _chance(off, G, uncertainty)
        half = np.array([uncertainty.of(np.eye(solved.setup.size)[at + k]) for k in range(count)])
        scale = against if name == "rest" else 1.0
        differs = chance < CHANCE and bool((np.abs(off / scale) > LEAST[name]).any())
        judgements[name] = Judged(values, half, chance, differs)
        if differs:
            kept.append(name)
    return judgements, tuple(kept)


def _chance(off: Array, G: Array, uncertainty: Spread) -> float:
    """Wald's test: the correlation by the noise's estimate, sizes and degrees of freedom as for intervals; 1 where the
    data say nothing."""
    own, degrees = zip(*(uncertainty.variance(row) for row in G), strict=True)
    with np.errstate(over="ignore", invalid="ignore"):
        V = G @ uncertainty.noise @ G.T
    if not (np.isfinite(V).all() and np.isfinite(own).all()):
        return 1.0
    sizes = np.sqrt(np.array(own) / np.maximum(np.diagonal(V), 1e-300))
    V = V * np.outer(sizes, sizes)
    scale = np.sqrt(np.maximum(np.diagonal(V), 1e-300))
    back = np.linalg.pinv(V / np.outer(scale, scale), rcond=1e-10, hermitian=True)
    statistic = float((off / scale) @ back @ (off / scale)) / len(off)
    return float(fdtrc(len(off), max(min(degrees), 1.0), statistic))


def _as_result(judgements: dict[str, Judged], kept: tuple[str, ...]) -> tuple[FallTest, ...]:
    rows = []
    for extra, names in NAMES.items():
        for k, name in enumerate(names if extra in judgements else ()):
            one, scale = judgements[extra], 100.0 if extra == "excess" else 1.0
            value, half = scale * float(one.values[k]), scale * float(one.half[k])
            known = half < WIDEST and extra != "rest"
            ends = (value - half, value + half) if known else None
            rows.append(FallTest(name, value, ends, one.chance, extra in kept))
    return tuple(rows)


def _findings(solved: Solved, judgements: dict[str, Judged], kept: tuple[str, ...]) -> tuple[Finding, ...]:
    (edge1, edge2), findings = edges(solved).tolist(), [finding("release-not-seen", "release")]
    if "rest" in judgements:
        (tau1, tau2), chance = judgements["rest"].values.tolist(), judgements["rest"].chance
        findings = [finding("release-alike", "release", tau1_s=edge1, tau2_s=edge2, chance=chance)]
        if "rest" in kept:
            own = {"tau1_s": tau1, "tau2_s": tau2, "edge1_s": edge1, "edge2_s": edge2}
            findings = [finding("release-differs", "release", (), **own, chance=chance)]
    if "fall" in kept:
        (tau1, tau2), chance = judgements["fall"].values.tolist(), judgements["fall"].chance
        findings.append(finding("falls-differ", "nonlinear", tau1_factor=tau1, tau2_factor=tau2, chance=chance))
    if "excess" in kept:
        (excess,), chance = judgements["excess"].values.tolist(), judgements["excess"].chance
        findings.append(finding("hysteresis", "nonlinear", excess_pct=100 * excess, chance=chance))
    return tuple(findings)
