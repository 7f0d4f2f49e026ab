"""Do falls in recorded logs go as rises do? Tested on the data, and fitted where they differ; of one lag, or two in
parallel.

    rest     τ1, τ2 of falls to rest against those of the lowest identified input, or of the input that was left
    fall     factors on τ1, τ2 of falls between identified inputs against 1
    excess   T_s after a fall of a stepwise input, T_s (1 + h), against h = 0

Each is an unknown (or two) beside the coefficients; Wald's test with the covariance of the coloured residuals. Falls to
rest that would make the lowest input surer than its own rises do keep numbers of their own, alike or not: that they go
as it does is an assumption, which no interval holds.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from eaid.arrays import Array, scaled_inverse
from eaid.estimate.forms import SLOWEST_TAU
from eaid.findings import Finding, finding
from eaid.levels.release import LEFT_SAVES
from eaid.plant.drive import fall_alone
from eaid.plant.forms import PerLevel
from eaid.recorded.from_logs import NO_EXTRAS, Setup, Solved, come_near, fit_near, fit_through
from eaid.recorded.inputs import FEW_LEVELS, Excited
from eaid.recorded.log_intervals import Spread, spread
from eaid.results.recorded import FallTest

FALL_CHANCE = 1e-3  # A difference is taken over where chance makes one as large more rarely than this …
MAKES_SURER = 0.9  # Half-widths at the lowest input over those with falls to rest of their own, from which it is none
LEAST_DIFFERENCE = {"rest": 0.1, "fall": 0.05, "excess": 0.003}  # … and it is larger than this part
# The numbers of each as results name them
FALL_NAMES = {
    "rest": ("release_tau1", "release_tau2"),
    "fall": ("fall_tau1", "fall_tau2"),
    "excess": ("hysteresis_pct",),
}
WIDEST_HALF = 1e6  # Half-width beyond which there is no interval


def list_tests(setup: Setup, stepwise: bool, free: bool) -> tuple[str, ...]:
    """Which of the three the inputs can tell: one that moves and is not free, but a loop's, tells none in between,
    falls to rest that go as the input that was left have none of their own, and where nothing rises they are the
    plant's."""
    rests = falls = 0
    for drive in setup.drives:
        level = drive.duty[drive.which]
        fell = np.flatnonzero((level[:-1] > 0) & (level[1:] == 0))
        rests += any(int((level[at + 1 :] == 0).argmin() or len(level) - at - 1) >= 8 for at in fell)
        falls += int(((level[1:] < level[:-1]) & (level[1:] >= setup.model.low)).sum())
    of_falls = ("fall", *("excess",) * bool(stepwise)) if falls >= 2 and (stepwise or free) else ()
    return (*("rest",) * (bool(rests) and not setup.falls_as_left), *of_falls) if not fall_alone(setup.drives) else ()


def test_falls(base: Solved, inputs: Excited, free: bool) -> tuple[Solved, tuple[FallTest, ...], tuple[Finding, ...]]:
    """Test all that the inputs can tell together, then fit again with those that differ: they are its extras. Where
    levels are held, with T_s of each: falls imitate what a curve through them misses."""
    base, names = without_falls(base), list_tests(base.setup, inputs.stepwise, free)
    judgements: dict[str, Judged] = {}
    if names:
        model, by_levels = base.setup.model, base
        if inputs.stepwise and model.slices[0].stop < len(inputs.levels) <= FEW_LEVELS and not model.signed:
            by_levels = fit_through(base, PerLevel(tuple(inputs.levels.tolist())))
        whole = fit_with_falls(by_levels, names)
        known = spread(whole)
        judgements = _judge(whole, names, known)
        of_input = "rest" in names and model.tau1.size > 1  # lags that are constant have no lowest input of their own
        ended = of_input and judgements["rest"].ends
        own = ("rest",) if ended and _makes_surer(by_levels, whole, known) else ()
        differing = tuple(name for name in names if judgements[name].differs or name in own)
        plain = base
        while differing:  # alone one may differ no longer
            same = by_levels is plain and differing == names
            base = whole if same else fit_with_falls(plain, differing)
            judgements |= _judge(base, differing, known if same else spread(base))
            still = tuple(name for name in differing if judgements[name].differs or name in own)
            if still == differing:
                break
            base, differing = plain, still
    rows = []
    for extra, numbers in FALL_NAMES.items():
        for k, name in enumerate(numbers[: len(judgements[extra].values)] if extra in judgements else ()):
            one, scale = judgements[extra], 100.0 if extra == "excess" else 1.0
            value, half = scale * float(one.values[k]), scale * float(one.half[k])
            ends = (value - half, value + half) if half < WIDEST_HALF and extra != "rest" else None
            rows.append(FallTest(name, value, ends, one.chance, extra in base.setup.extras))
    return base, tuple(rows), _falls_findings(base, judgements)


def fit_falls_as_left(base: Solved) -> Solved:
    """The fit with falls to rest that go with the time constants of the input that was left, where that explains the
    logs better than constants of their own do; itself where it does not, or one input was left."""
    drives, model = base.setup.drives, base.setup.model
    left = np.concatenate([drive.paces[drive.duty == 0] for drive in drives])
    if model.tau1.size < 2 or len(np.unique(np.clip(left[left > 0], model.low, model.high))) < 2:
        return base
    own = come_near(*add_falls(base, ("rest",)))
    found = come_near(replace(base.fitted, falls_as_left=True), base.x)
    better = found.cost < (1 - LEFT_SAVES) * min(own.cost, base.cost)
    return fit_near(found.fitted, found.x) if better else base


@dataclass(frozen=True, eq=False)
class Judged:
    """Values of one extra, their half-widths, and the chance of a difference as large."""

    values: Array
    half: Array
    chance: float
    differs: bool
    ends: bool  # Whether the records show an end of each


def lowest_taus(solved: Solved) -> Array:
    """τ1 and τ2 of the lowest identified input, (2,)."""
    tables = solved.curves(np.array([solved.setup.model.low]))
    return np.array([tables.tau1[0], tables.tau2[0]])


def as_rises(solved: Solved, name: str) -> Array:
    """Values of an extra with which falls go as rises do."""
    return lowest_taus(solved) if name == "rest" else np.array(NO_EXTRAS[name])


def fit_with_falls(base: Solved, names: tuple[str, ...]) -> Solved:
    """The fit with some of rest, fall and excess as unknowns beside its own."""
    return fit_near(*add_falls(base, names))


def add_falls(base: Solved, names: tuple[str, ...]) -> tuple[Setup, Array]:
    """The setup of a fit with these, and its unknowns as if falls went as rises do."""
    begin = np.concatenate([as_rises(base, name) for name in names])
    x, before, dead = base.x, base.fitted, base.fitted.at("dead")
    own = x[before.shared :] if dead < 0 else np.append(x[dead], x[before.shared :])
    extras = names if dead < 0 else (*names, "dead")
    return replace(before, extras=extras), np.r_[x[: before.model.size], begin, own]


def without_falls(solved: Solved) -> Solved:
    """The fit with falls that go as rises do; itself where they do."""
    setup, x = solved.fitted, solved.x
    if not (fallen := tuple(name for name in setup.extras if name != "dead")):
        return solved
    of_falls = [setup.at(name) + k for name in fallen for k in range(len(NO_EXTRAS[name]))]
    return fit_near(replace(setup, extras=setup.extras[len(fallen) :]), np.delete(x, of_falls))


def _makes_surer(base: Solved, whole: Solved, of_whole: Spread) -> bool:
    """Whether falls that go as the lowest input narrow what is known of its τ1 or τ2."""
    halves, low = [], np.array([base.setup.model.low])
    for solved, known in ((base, spread(base)), (whole, of_whole)):
        rows = solved.setup.slopes(low)[1 : 2 + (solved.setup.model.tau2 is not None), 0]
        halves.append([known.of(row) for row in rows])
    tied, own = np.array(halves)
    return bool((tied < MAKES_SURER * own).any())


def _judge(solved: Solved, names: tuple[str, ...], uncertainty: Spread) -> dict[str, Judged]:
    judgements, model = {}, solved.setup.model
    for name in names:
        at, count = solved.setup.at(name), len(NO_EXTRAS[name]) if model.tau2 is not None else 1
        G = np.zeros((count, solved.setup.size))
        G[:, at : at + count] = np.eye(count)
        values = solved.x[at : at + count]
        against = as_rises(solved, name)[:count]
        if name == "rest":  # the edge values are estimates too
            G -= solved.setup.slopes(np.array([model.low]))[1 : 1 + count, 0]
        off = values - against
        chance = _chance(off, G, uncertainty)
        if count == 2 and chance >= FALL_CHANCE:  # a τ2 that no log shows hides what τ1 tells
            chance = min(chance, _chance(off[:1], G[:1], uncertainty))
        half = np.array([uncertainty.of(np.eye(solved.setup.size)[at + k]) for k in range(count)])
        scale = against if name == "rest" else 1.0
        longest_s = max(float(drive.dt_s.sum()) for drive in solved.setup.drives)
        ends = name != "rest" or bool((values <= SLOWEST_TAU * longest_s).all())
        seen = np.abs(off) > np.array([uncertainty.of(row) for row in G])  # one of both by itself, too
        differs = ends and chance < FALL_CHANCE and bool((seen & (np.abs(off / scale) > LEAST_DIFFERENCE[name])).any())
        judgements[name] = Judged(values, half, chance, differs, ends)
    return judgements


@np.errstate(over="ignore", invalid="ignore")  # what nothing determines has no bound
def _chance(off: Array, G: Array, uncertainty: Spread) -> float:
    """Wald's test: the correlation by the noise's estimate, sizes and degrees of freedom as for intervals; 1 where the
    data say nothing."""
    own, degrees = zip(*(uncertainty.variance(row) for row in G), strict=True)
    V = G @ uncertainty.noise @ G.T
    if not (np.isfinite(V).all() and np.isfinite(own).all()):
        return 1.0
    sizes = np.sqrt(np.array(own) / np.maximum(np.diagonal(V), 1e-300))
    statistic = float(off @ scaled_inverse(V * np.outer(sizes, sizes), 1e-10) @ off) / len(off)
    return float(fdtrc(len(off), max(min(degrees), 1.0), statistic))


def _falls_findings(solved: Solved, judgements: dict[str, Judged]) -> tuple[Finding, ...]:
    seen = "release-as-left" if solved.setup.falls_as_left else "release-not-seen"
    seen = "rise-not-seen" if fall_alone(solved.setup.drives) else seen
    findings, kept = [finding(seen, "release")], solved.setup.extras
    if "rest" in judgements:
        taus_s, chance = tuple(judgements["rest"].values.tolist()), judgements["rest"].chance
        edges_s = tuple(lowest_taus(solved)[: len(taus_s)].tolist())
        code = "release-alike" if "rest" not in kept else "release-own"
        code = "release-differs" if judgements["rest"].differs else code
        findings = [finding(code, "release", taus_s=taus_s, edges_s=edges_s, chance=chance)]
    if "fall" in kept:
        factors, chance = tuple(judgements["fall"].values.tolist()), judgements["fall"].chance
        findings.append(finding("falls-differ", "nonlinear", factors=factors, chance=chance))
    if "excess" in kept:
        (excess,), chance = judgements["excess"].values.tolist(), judgements["excess"].chance
        findings.append(finding("hysteresis", "nonlinear", excess_pct=100 * excess, chance=chance))
    return tuple(findings)
