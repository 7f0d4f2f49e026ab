"""Every number that is measured on a replay: steps, tones, drawn plants, modes of the rehabilitation and their tests.

Units are the rig's; `_nm` and `_pct` in a name say what they are on the paper's rig.
Errors are reference − true output.
"""

import msgspec

from eaid.results.common import Count, Number, Positive, Result
from eaid.results.gain_checks import Tracking


class StepMetrics(Result, frozen=True):
    """One step of the reference, watched until the next; None: never reached."""

    from_nm: Number
    to_nm: Number
    rise_time_s: Number | None = None
    """10 to 90 %."""
    overshoot_pct: Number | None = None
    settling_s: Number | None = None
    """2 % band."""
    settling_5pct_s: Number | None = None


class ToneMetrics(Result, frozen=True):
    """One frequency of a sweep."""

    frequency_hz: Positive
    gain_db: Number | None = None
    """Least-squares fundamental of the output over that of the reference, over whole periods."""
    phase_deg: Number | None = None
    mean_abs_error_nm: Number | None = None


class Worst(Result, frozen=True):
    """The plant on which a metric is worst, and its coefficients."""

    value: Number | None = None
    plant: Count = 0
    tau1: tuple[Number, ...] = ()
    tau2: tuple[Number, ...] = ()
    Ts: tuple[Number, ...] = ()


class Distribution(Result, frozen=True):
    """One metric over the drawn plants that reach it."""

    worst: Worst = Worst()
    mean: Number | None = None
    sd: Number | None = None
    low: Number | None = msgspec.field(default=None, name="p2.5")
    median: Number | None = None
    high: Number | None = msgspec.field(default=None, name="p97.5")
    never: Count = 0
    """Plants that never reach it."""


class PlantSpread(Result, frozen=True):
    """All metrics over the drawn plants."""

    count: Count
    metrics: dict[str, Distribution] = {}


class Box(Result, frozen=True):
    """The numbers of a box plot."""

    n: Count
    independent: Number
    """How many independent observations the samples are worth."""
    mean: Number
    sd: Number
    q1: Number
    median: Number
    q3: Number
    whisker_low: Number
    whisker_high: Number
    outliers: Count


class ModeMetrics(Result, frozen=True):
    """One mode of the rehabilitation."""

    abs_position_error_deg: Box
    cycle_means_deg: tuple[Number, ...] = ()
    mean_abs_torque_error_nm: Number | None = None
    max_abs_torque_error_nm: Number | None = None
    torque_loop: Tracking | None = None


class Normality(Result, frozen=True):
    """A test of normality; a small p rejects it."""

    test: str
    statistic: Number
    p: Number
    rejected: bool


class SampleTest(Result, frozen=True):
    """The paper's test, on samples taken as independent."""

    test: str
    n: tuple[Count, Count]
    t: Number
    p: Number


class CycleTest(Result, frozen=True):
    """Tests on the means of whole movement cycles; None where too few are whole."""

    n: tuple[Count, Count]
    t: Number | None = None
    df: Number | None = None
    p_welch: Number | None = None
    U: Number | None = None
    p_rank: Number | None = None
    least_p_rank: Number | None = None


class ModesTest(Result, frozen=True):
    """Whether two modes differ."""

    modes: tuple[str, str]
    samples: SampleTest
    cycles: CycleTest


class Metrics(Tracking, frozen=True):
    """Everything measured on one group; a field that the group does not have is None or empty."""

    counted_from_s: Number | None = None
    """Samples before this instant do not count."""
    steps: tuple[StepMetrics, ...] = ()
    frequencies: tuple[ToneMetrics, ...] = ()
    guarantee_holds_fraction: Number | None = None
    """Share of the samples at which |χ| ≤ ρ."""
    guarantee_largest_chi_over_rho: Number | None = None
    guarantee_failures_at_limit: Number | None = None
    guarantee_failures_by_saturation: Number | None = None
    plants: PlantSpread | None = None
    modes: dict[str, ModeMetrics] = {}
    turn_step_nm: Number | None = None
    normality: dict[str, Normality] = {}
    tests: tuple[ModesTest, ...] = ()
    max_abs_difference_nm: Number | None = None
    """Of a recorded input: recorded − model."""
    rms_difference_nm: Number | None = None
    mean_difference_nm: Number | None = None
    R2: Number | None = None
    """1 − Σ (recorded − model)²/Σ (recorded − mean recorded)²"""
    fit_pct: Number | None = None
    """Free run: 100 (1 − ‖recorded − model‖/‖recorded − mean recorded‖)"""
    one_step_pct: Number | None = None
    """The same for recorded_k + (model_k+1 − model_k) as the prediction of row k + 1."""
    idle_nm: Number | None = None
    """What was subtracted from the recorded output."""
    start_nm: Number | None = None
    """Output from which the model starts."""
    reference_is: str | None = None
    rms_from_recorded_nm: Number | None = None
    rms_duty_from_recorded_pct: Number | None = None
