"""The statistics of Fig. 17: box plots of the absolute position error, and what may be concluded from them.

The paper tests samples against samples (Student's t after a normality test with p < 0.001, which rejects normality).
Samples 1 ms apart are no independent observations: `independent` says how many they are worth,
n / (1 + 2 Σ ρ_k) up to the first autocorrelation ρ_k that is not positive. Beside the paper's test stand two on the
means of whole movement cycles: Welch's t, and the exact rank test of Mann and Whitney with the least p it can give.
"""

import itertools
import math

import msgspec
import numpy as np
from scipy import stats

from eaid.arrays import Array
from eaid.replay.rehab import MODES, Session
from eaid.replay.scenarios import record as loop_record
from eaid.results.metrics import Box, CycleTest, Metrics, ModeMetrics, ModesTest, Normality, SampleTest
from eaid.results.replay import Record


def statistics(session: Session) -> Metrics:
    """Errors of the torque loop over all counted samples; boxes, normality and tests by mode, |position error| in °."""
    dt_s = session.replay.dt_s
    error_deg = {mode: np.abs(session.position_error_deg[session.counted(mode)]) for mode in MODES}
    cycle = round(1 / session.exercise.movement_hz / dt_s)
    means = {mode: cycle_means(values, cycle) for mode, values in error_deg.items()}
    counted = np.concatenate([np.arange(len(session.mode))[session.counted(mode)] for mode in MODES])
    return Metrics(
        **msgspec.structs.asdict(session.replay.tracking(counted)),
        modes={mode: _mode(session, mode, error_deg[mode], means[mode]) for mode in MODES},
        turn_step_nm=session.turn_step_nm,
        normality={mode: normality(values) for mode, values in error_deg.items()},
        tests=tuple(
            ModesTest(
                (first, second),
                by_samples(error_deg[first], error_deg[second]),
                by_cycles(means[first], means[second]),
            )
            for first, second in itertools.combinations(MODES, 2)
        ),
    )


def record(session: Session) -> Record:
    """A session as a group of replay.h5: the torque loop, the limb, and the statistics."""
    return loop_record(session.replay, statistics(session), session.columns())


def _mode(session: Session, mode: str, error_deg: Array, means: Array) -> ModeMetrics:
    part = session.counted(mode)
    torque = np.abs(session.torque_error_nm[part])
    return ModeMetrics(
        box(error_deg), tuple(means.tolist()), float(torque.mean()), float(torque.max()), session.replay.tracking(part)
    )


def box(values: Array) -> Box:
    """The numbers of a box plot: quartiles (linear), whiskers within 1.5 quartile ranges, outliers."""
    q1, median, q3 = (float(q) for q in np.percentile(values, [25, 50, 75]))
    reach = 1.5 * (q3 - q1)
    inside = values[(values >= q1 - reach) & (values <= q3 + reach)]
    return Box(
        n=values.size,
        independent=independent(values),
        mean=float(values.mean()),
        sd=float(values.std(ddof=1)),
        q1=q1,
        median=median,
        q3=q3,
        whisker_low=float(inside.min()),
        whisker_high=float(inside.max()),
        outliers=values.size - inside.size,
    )


def independent(values: Array) -> float:
    """How many independent observations a series is worth, n / (1 + 2 Σ ρ_k), k up to the first ρ_k ≤ 0."""
    n = values.size
    away = values - values.mean()
    power = float(away @ away)
    if power == 0.0:
        return 1.0
    spectrum = np.abs(np.fft.rfft(away, 2 * n)) ** 2
    rho = np.fft.irfft(spectrum)[:n] / power
    ends = np.flatnonzero(rho <= 0)
    last = int(ends[0]) if ends.size else n
    return min(float(n), n / (1 + 2 * float(rho[1:last].sum())))


def cycle_means(values: Array, cycle: int) -> Array:
    """Mean over each whole movement cycle of so many samples, from the first sample on."""
    whole = values.size // cycle
    means: Array = values[: whole * cycle].reshape(whole, cycle).mean(axis=1)
    return means


def normality(values: Array) -> Normality:
    """D'Agostino and Pearson's K² on all samples; a small p says that they are not normal."""
    found = stats.normaltest(values)
    return Normality("D'Agostino-Pearson", float(found.statistic), float(found.pvalue), bool(found.pvalue < 0.05))


def by_samples(first: Array, second: Array) -> SampleTest:
    """The paper's test: Student's t with pooled variance on all samples, as if they were independent."""
    found = stats.ttest_ind(first, second)
    name = "Student, samples taken as independent"
    return SampleTest(name, (first.size, second.size), float(found.statistic), float(found.pvalue))


def by_cycles(first: Array, second: Array) -> CycleTest:
    """Welch's t and the exact rank test on the means of movement cycles; None where too few cycles are whole."""
    n, m = first.size, second.size
    if min(n, m) == 0:
        return CycleTest((n, m))
    rank = stats.mannwhitneyu(first, second, method="exact")
    found = CycleTest((n, m), U=float(rank.statistic), p_rank=float(rank.pvalue), least_p_rank=2 / math.comb(n + m, n))
    if min(n, m) < 2:
        return found
    if not first.std() + second.std() > 0:
        return found
    welch = stats.ttest_ind(first, second, equal_var=False)
    return msgspec.structs.replace(found, t=float(welch.statistic), df=float(welch.df), p_welch=float(welch.pvalue))
