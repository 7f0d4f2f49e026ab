"""fit.json as types: what was fitted, how well, how sure, and what is to be doubted.

Keys are the paper's symbols, polynomials lowest power first, units those of the rig (`data.input_unit`,
`data.output_unit`); time constants in s.
"""

import math
import os
import statistics
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec

from eaid.errors import DataError, in_python
from eaid.findings import Finding
from eaid.models.nonlinear import time_constants
from eaid.models.parameters import SHARE, TAU_FLOOR_S
from eaid.models.parameters import Linear as LinearModel
from eaid.models.parameters import Nonlinear as NonlinearModel
from eaid.results import codec
from eaid.results.common import Count, Input, Number, Positive, Result, Source
from eaid.results.friction import Friction, FrictionLevel, Release
from eaid.results.linear import Linear
from eaid.results.nonlinear import Nonlinear
from eaid.results.recorded import Recorded
from eaid.results.steps import StepShape
from eaid.results.uncertainty import Uncertainty
from eaid.shown import Shown

if TYPE_CHECKING:
    import pandas


class Rig(Result, frozen=True):
    """The apparatus, as in `eaid.apparatus.Apparatus`."""

    inner_radius_m: Positive = 0.04
    outer_radius_m: Positive = 0.06
    surfaces: Annotated[int, msgspec.Meta(ge=1, le=10**6)] = 2
    dielectric_m: Positive = 95e-6
    voltage_v: Positive = 300.0
    pwm_hz: Positive = 300.0
    sample_rate_hz: Positive = 1000.0
    lever_ratio: Positive = 4.33

    def __post_init__(self) -> None:
        inner, outer = self.inner_radius_m, self.outer_radius_m
        if inner >= outer:
            raise ValueError(f"an inner radius of {inner:g} m and an outer one of {outer:g} m")


class FittedData(Result, frozen=True):
    """What was fitted."""

    kind: Literal["clutch", "friction-force", "friction-speed"] = "clutch"
    input_unit: str = "%"
    output_unit: str = "N·m"
    levels: tuple[Number, ...] = ()
    repeats: tuple[Count, ...] = ()
    samples: tuple[Count, ...] = ()
    record_s: tuple[Number, ...] = ()
    """Length of each level's record [s]."""
    sample_rate_hz: Positive | None = None
    apparatus: Rig = Rig()
    sources: tuple[Source, ...] = ()
    inputs: tuple[Input, ...] = ()
    synthetic: str | None = None
    """What made the data, where no rig did."""


class FitOptions(Result, frozen=True):
    """How a set of steps is fitted; the tables of choices stand in `eaid.fitting.choices`."""

    models: tuple[str, ...] | None = None
    """Models to fit; None: all that the kind allows."""
    share: Number | Literal["free"] = SHARE
    """C, held, or free."""
    loss: str = "squares"
    """squares, or huber (1.345 robust standard deviations)."""
    hold_out: tuple[Number, ...] = ()
    """Levels that are not fitted; the error on them is reported."""
    bounds_levels: tuple[Number, ...] | None = None
    """Levels over which B_m and B_M are taken; None: all that are fitted."""
    estimator: str = "auto"
    """joint: all coefficients together, as in the paper. two-stage: each level, then the polynomials through them.
    auto: the one that the evidence supports."""
    shape: str = "auto"
    """Shape of steps between levels: auto (by the evidence), one, two, free or overshoot."""
    dead_time_s: Number | None = None
    """Dead time of each single step [s]; None: where the evidence asks for one; 0: none."""
    ci: str = "robust"
    """How 95 % intervals are found: robust, bootstrap, white or none."""
    draws: Count = 300
    """Refits of the bootstrap."""
    seed: Count = 0
    """Of the bootstrap."""

    @property
    def held_share(self) -> float | None:
        """C where it is held, None where it is free."""
        return None if self.share == "free" else self.share


class FitAsked(FitOptions, frozen=True):
    """What was asked for, reading options too, so that it can be done again."""

    reading: dict[str, str | float | bool | None] = {}


NOT_IDENTIFIABLE = (
    "one-level-nonlinear",
    "one-level-linear",
    "no-level-determines-all",
    "parameter-open-at-most-levels",
    "a0-may-be-zero",
    "b0-may-be-zero",
    "no-b-bounds",
)
"""Codes of the findings that make a model not identifiable."""


class Fit(Shown, Result, frozen=True):
    """All that one call fitted; what its kind does not allow is None.

    Examples
    --------
    >>> import eaid
    >>> fit = eaid.fit(eaid.synth(levels=(20.0, 60.0, 100.0), repeats=2, rate_hz=50.0, seed=1))
    >>> fit.predict(duty=[60.0, 100.0], t=[0.0, 1.0, 10.0]).shape
    (3, 2)
    >>> fit.linear.bounds.B_m < fit.linear.bounds.B_M
    True
    """

    options: FitAsked = FitAsked()
    command: tuple[str, ...] = ()
    """What was typed to make it, without the output; empty where Python did."""
    seed: int = 0
    """That of `options`, under the key that every result file has."""
    data: FittedData = FittedData()
    converged: bool | None = None
    friction: Friction | None = None
    nonlinear: Nonlinear | None = None
    linear: Linear | None = None
    release: Release | None = None
    uncertainty: Uncertainty | None = None
    steps: tuple[StepShape, ...] = ()
    """Each change of input between two holds by itself, where a log goes from level to level."""
    recorded: Recorded | None = None
    """Of logs that were fitted as they were recorded."""
    findings: tuple[Finding, ...] = ()
    """Worst first."""

    @property
    def params(self) -> "pandas.Series[float]":
        """All fitted parameters, indexed by (model, parameter)."""
        from eaid.results import frames

        return frames.parameters(self)

    def conf_int(self) -> "pandas.DataFrame":
        """95 % intervals of `params`, columns low and high; NaN where the data say nothing of use."""
        from eaid.results import frames

        return frames.intervals(self)

    def to_frame(self) -> "pandas.DataFrame":
        """One row a level, or a step between two: its curve with intervals, and the error of each model."""
        from eaid.results import frames

        return frames.levels(self)

    def predict(
        self, duty: float | Sequence[float], t: Sequence[float], model: str | None = None
    ) -> "pandas.DataFrame":
        """The output after a step from rest to each input [input's unit] at times t [s]; inputs are the columns.

        `model` is nonlinear, linear or friction; by default the first of these that was fitted.
        """
        from eaid.results import frames

        return frames.predict(self, duty, t, model)

    def summary(self) -> str:
        """The fit in a few lines: fit %, T_s, τ1, τ2 with intervals, which estimate was taken, what is doubtful."""
        from eaid.results.summary import fit_summary

        return in_python("\n".join(fit_summary(self)))

    def plot(self, ax: Any = None) -> Any:
        """The step responses of the fitted models, on matplotlib Axes."""
        from eaid.report.plots import plot_fit

        return plot_fit(self, ax)

    def save(self, path: str | os.PathLike[str], force: bool = False) -> None:
        """Write fit.json, whole or not at all; an existing file is left alone unless `force`."""
        codec.write(Path(path), self, "fit", force)

    @property
    def plant(self) -> NonlinearModel:
        """The believed nonlinear model, with the release constants where falls to rest were fitted.

        Recorded falls between levels get them too where they are nearer the release than the rise, in log τ1 + log τ2.
        """
        if self.nonlinear is None:
            raise DataError("this fit holds no nonlinear model; fit clutch logs with «model» nonlinear")
        if self.release is None:
            return self.nonlinear.parameters
        release = (self.release.tau1, self.release.tau2)
        model = replace(self.nonlinear.parameters, release=release)
        nearer = 0.0
        for row in self.recorded_falls:
            for tau, up, down in zip((row.tau1, row.tau2), time_constants(model, row.level), release, strict=True):
                nearer += abs(math.log(tau / max(float(up), TAU_FLOOR_S))) - abs(math.log(tau / down))
        return replace(model, falls_as_release=nearer > 0)

    @property
    def recorded_falls(self) -> tuple[FrictionLevel, ...]:
        """The fitted steps that fall from one level to another, not to rest."""
        return tuple(row for row in self.friction_levels if row.from_ > row.level > 0)

    @property
    def friction_levels(self) -> tuple[FrictionLevel, ...]:
        """The friction curves of levels, and of steps between them; none where they were not fitted."""
        return self.friction.levels if self.friction is not None else ()

    @property
    def dead_time_s(self) -> float:
        """Median dead time of the single steps upwards [s]; 0 where most of them show none."""
        return statistics.median_low([step.dead_time_s for step in self.steps if step.edge == "up"] or [0.0])

    def not_identifiable_because(self, subject: str) -> tuple[Finding, ...]:
        """Why the data do not determine a model: friction, nonlinear or linear."""
        return tuple(found for found in self.findings if found.subject == subject and found.code in NOT_IDENTIFIABLE)

    @property
    def linear_model(self) -> LinearModel:
        """The pooled linear model."""
        if self.linear is None:
            raise DataError("this fit holds no linear model; fit clutch logs with «model» linear")
        return self.linear.parameters
