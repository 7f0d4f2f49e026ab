"""replay.h5 as types: what each controller did, column by column, and every number measured on it.

Units are the rig's: `input_unit` for duties, `output_unit` for torques; `_nm` and `_pct` in a name say what they are on
the paper's rig. Errors are reference − true output.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Self

import msgspec

from eaid.arrays import Array
from eaid.findings import Finding, sentences
from eaid.options import RigExtras
from eaid.results.common import Count, Inputs, Made, Number, Positive, Result
from eaid.results.gains import Tracking
from eaid.shown import Plotted, pandas

# The columns that every group has, beside what a scenario adds
COLUMNS = ("time_s", "reference_nm", "torque_nm", "duty_pct")


class StepMetrics(Result, frozen=True):
    """One step of the reference, watched until the next; None: never reached."""

    from_nm: Number
    to_nm: Number
    rise_time_s: Number | None = None
    """10 to 90 %."""
    overshoot_pct: Number | None = None
    settling_s: Number | None = None
    """2 % band."""


class ToneMetrics(Result, frozen=True):
    """One frequency of a sweep."""

    frequency_hz: Positive
    gain_db: Number | None = None
    """Least-squares fundamental of the output over that of the reference, over whole periods."""
    phase_deg: Number | None = None
    mean_abs_error_nm: Number | None = None


class Worst(Result, frozen=True):
    """The plant on which a metric is worst."""

    value: Number | None = None
    plant: Count = 0


class Distribution(Result, frozen=True):
    """One metric over the drawn plants."""

    worst: Worst = Worst()
    low: Number | None = msgspec.field(default=None, name="p2.5")
    median: Number | None = None
    high: Number | None = msgspec.field(default=None, name="p97.5")


class PlantSpread(Result, frozen=True):
    """How well the output follows, over the drawn plants."""

    count: Count
    metrics: dict[str, Distribution] = {}


class Box(Result, frozen=True):
    """Mean and quartiles."""

    mean: Number
    q1: Number
    median: Number
    q3: Number


class ModeMetrics(Result, frozen=True):
    """One mode of the rehabilitation."""

    abs_position_error_deg: Box
    cycle_means_deg: tuple[Number, ...] = ()
    mean_abs_torque_error_nm: Number | None = None
    normality_p: Number | None = None
    """D'Agostino and Pearson's test; a small p says that the position errors are not normal."""


class SampleTest(Result, frozen=True):
    """The paper's test, Student's t on samples taken as independent."""

    n: tuple[Count, Count]
    t: Number
    p: Number


class CycleTest(Result, frozen=True):
    """The exact rank test on the means of whole movement cycles; None where none is whole."""

    n: tuple[Count, Count]
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
    plants: PlantSpread | None = None
    modes: dict[str, ModeMetrics] = {}
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


Role = Literal["controller", "recorded-input"]
"""A controller; a recorded input through the model."""


@dataclass(frozen=True, eq=False, repr=False)
class Record:
    """One group of replay.h5: columns of one length by name, and what was measured on them."""

    columns: Mapping[str, Array]
    """`time_s`, `reference_nm`, `torque_nm`, `duty_pct` and others, each of shape (n,)."""
    metrics: Metrics = Metrics()  # noqa: RUF009 - frozen
    tables: Mapping[str, Array] = field(default_factory=dict)
    """Further arrays of any length, as `plants/band_nm`, in inner groups named before the slash."""
    role: Role = "controller"


class Exercise(Result, frozen=True):
    """The rehabilitation: exercise, limb and its owner; specification 7's defaults."""

    mode_s: Number = 30.0  # Length of each mode [s]
    uncounted_s: Number = 5.0  # Start of each mode that the statistics leave out [s]
    centre_deg: Number = 35.0
    amplitude_deg: Number = 25.0  # Target: centre − amplitude cos(2π f t) [°]
    movement_hz: Number = 0.15
    soft_nm_rad: Number = 1.0
    hard_nm_rad: Number = 3.0  # Stiffness of the resistive modes, from 10° on
    assist_proportional: Number = 3.0  # K_P [N·m/rad]
    assist_integral: Number = 10.0  # K_I [N·m/(rad·s)]
    blend_s: Number = 0.5  # Scale of the tanh that blends the modes [s]
    slope_nm_s: Number = 20.0  # Fastest change of the torque reference
    inertia_kgm2: Number = 0.1
    damping_nms: Number = 0.8  # [N·m·s/rad]
    gravity_nm: Number = 1.5  # Moment of the forearm's weight, times sin θ
    user_stiffness: Number = 8.0  # [N·m/rad]
    user_damping: Number = 1.0  # [N·m·s/rad]
    user_delay_s: Number = 0.12
    tremor_nm: Number = 0.3  # Standard deviation of the user's random moment
    tremor_s: Number = 0.5  # Time in which it forgets itself

    def scaled(self, top: float) -> Self:
        """The same movement by a limb and a user `top` times as strong: every moment and stiffness is scaled."""
        return msgspec.structs.replace(self, **{name: top * getattr(self, name) for name in MOMENTS})


MOMENTS = (
    "soft_nm_rad", "hard_nm_rad", "assist_proportional", "assist_integral", "slope_nm_s", "inertia_kgm2", "damping_nms",
    "gravity_nm", "user_stiffness", "user_damping", "tremor_nm",
)  # fmt: skip
"""What of an exercise is in proportion to the torque that it takes."""


class Head(Made, frozen=True):
    """What a replay says of itself: the root attributes of replay.h5."""

    scenario: str
    input_unit: str = "%"
    output_unit: str = "N·m"
    dt_s: Positive | None = None
    counted_from_s: Number | None = None
    exercise: Exercise | None = None
    plants: Count | None = None
    band_quantiles: tuple[Number, ...] = ()
    rig: RigExtras = RigExtras()
    not_usable: dict[str, str] = {}
    """What stands on a fit that must not be used, plant or gains, and why."""
    synthetic: str | None = None
    inputs: Inputs = {}


@dataclass(frozen=True, eq=False, repr=False)
class Replay(Plotted):
    """Controllers replayed on a fitted plant, or recorded runs laid beside it.

    Examples
    --------
    >>> import eaid
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> run = eaid.simulate(fit, scenario="steps", controller=("open-loop",))
    >>> run
    <Replay: steps: open-loop>
    >>> run.metrics()["open-loop"].rms_error_nm < 1
    True
    >>> run.to_frame().columns[:4].tolist()
    ['name', 'time_s', 'reference_nm', 'torque_nm']
    """

    head: Head
    records: Mapping[str, Record] = field(default_factory=dict)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is to be known before the numbers are used."""
        return self.head.findings

    @property
    def warnings(self) -> tuple[str, ...]:
        """The findings that are more than notes, as sentences."""
        return self.head.warnings

    def to_dict(self) -> dict[str, object]:
        """What `simulate --json` prints: all but the columns."""
        from eaid.results.replay_file import as_json

        return as_json(self)

    def metrics(self, role: Role = "controller") -> dict[str, Metrics]:
        """Metrics by name of the groups that play this part."""
        return {name: one.metrics for name, one in self.records.items() if one.role == role}

    def summary(self) -> str:
        """Scenario, the largest and the RMS error of each controller, and the gravest findings."""
        head = f"{self.head.scenario}: {', '.join(self.records) or 'nothing replayed'}"
        unit = self.head.output_unit
        rows = [
            f"{name}: largest error {one.max_abs_error_nm:.3g}, RMS {one.rms_error_nm:.3g} {unit}"
            for name, one in self.metrics().items()
            if one.max_abs_error_nm is not None and one.rms_error_nm is not None
        ]
        return "\n".join([head, *rows, *sentences(self.findings[:3])])

    def to_frame(self) -> "pandas.DataFrame":
        """All columns as one table, the group's name in `name`."""
        frames = [pandas.DataFrame({"name": name, **one.columns}) for name, one in self.records.items()]
        return pandas.concat(frames, ignore_index=True) if frames else pandas.DataFrame({"name": []})

    def save(self, path: str | os.PathLike[str], force: bool = False) -> None:
        """Write replay.h5, whole or not at all."""
        from eaid.results.replay_file import write_replay

        write_replay(Path(path), self, force)
