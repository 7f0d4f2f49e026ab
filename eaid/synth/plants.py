"""What is recorded synthetically: for each kind of experiment, the two exponentials that one input gives.

Clutch:          T_s(u), τ1(u), τ2(u) of the reference plant or of a fit, with the edges of specification 4.2.
Step, force: Table I as printed, over σ = f / A, at 15 RPM.
Step, speed: Table II's T_s and τ1 as printed, and τ2 = 5.4 e^(−0.0101 Ω) s, which agrees with Table I at 15 RPM
                 (the printed τ2 of Table II has nothing left at its own digits, specification 5).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp

import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.control.defaults import PAPER_TOP
from eaid.control.gains import plant_of
from eaid.errors import DataError, UsageError
from eaid.options import ExperimentKind
from eaid.plant.dynamics import REFERENCE_PLANT, SHARE, Plant, PlantNumbers, Step, plant_numbers, plant_terms
from eaid.plant.respond import Acting
from eaid.results.fit import Fit


@dataclass(frozen=True)
class Factors:
    """How one run differs from the plant: factors on T_s, τ1 and τ2."""

    gain: float = 1.0
    tau1: float = 1.0
    tau2: float = 1.0

    def of(self, step: Step) -> Step:
        """The step as this run has it."""
        return replace(step, Ts=step.Ts * self.gain, tau1=step.tau1 * self.tau1, tau2=step.tau2 * self.tau2)

    def on(self, model: Plant) -> Plant:
        """The model as this run has it."""
        tau1, tau2 = self.tau1, self.tau2
        return replace(
            model.scaled(self.gain),
            tau1=tuple(tau1 * c for c in model.tau1), tau2=tuple(tau2 * c for c in model.tau2),
            release=model.release and (tau1 * model.release[0], tau2 * model.release[1]),
        )  # fmt: skip


@dataclass(frozen=True)
class Specimen:
    """A thing to be recorded."""

    kind: ExperimentKind
    at: Callable[[float], Step]  # What an input leads to, held for ever
    rotor_rpm: float | None  # Rotor speed [RPM] (§III, §IV-A); None: the input is the speed [RPM]
    levels: tuple[float, ...]  # Inputs that are recorded unless the user names others, in the input's unit
    made_of: str  # What stands behind the numbers, in words
    model: Plant | None = None  # The clutch's own model; friction rigs have none
    input_unit: str = "%"
    output_unit: str = "N·m"

    @property
    def input_range(self) -> tuple[float, float]:
        """Lowest and highest identified input."""
        return self.model.u_range if self.model is not None else (min(self.levels), max(self.levels))

    @property
    def dead_time_s(self) -> float:
        """How late its output answers [s]."""
        return self.model.dead_time_s if self.model is not None else 0.0

    @property
    def is_duty(self) -> bool:
        """Whether the input is a duty cycle, which ends at 100 %."""
        return self.kind == "clutch" and self.input_unit == "%" and max(self.levels, default=0.0) <= 100

    @property
    def in_nm(self) -> bool:
        """Whether the output is a torque in N·m."""
        return self.output_unit in ("N·m", "Nm")

    @property
    def scale(self) -> float:
        """Output at the highest input over that of the reference plant, 4.372 N·m."""
        return self.at(max(self.levels)).Ts / PAPER_TOP

    def acting(self, run: Factors) -> Acting:
        """The plant of one run, as `eaid.plant.respond.driven` takes it."""
        if self.model is not None:
            numbers = plant_numbers(run.on(self.model))
            return lambda _value, _fell: numbers

        def acting(value: float, _fell: bool) -> PlantNumbers:
            step = run.of(self.at(value))
            return plant_numbers(Plant((step.tau1,), (step.tau2,), (step.Ts,), (0.0, 1.0), step.C))

        return acting

    def rotor_hz(self, value: Array) -> Array:
        """Turns a second of the rotor at these inputs [Hz], shape of `value`."""
        return (value if self.rotor_rpm is None else np.full_like(value, self.rotor_rpm)) / 60


def clutch(p: Plant = REFERENCE_PLANT, made_of: str = "the reference plant (docs/synthetic.md)") -> Specimen:
    """The clutch itself: input is the duty [%]."""
    parameters = plant_numbers(p)

    def at(duty_pct: float) -> Step:
        tau1, tau2, steady = plant_terms(parameters, duty_pct)
        return Step(steady, tau1, tau2, p.C)

    levels = tuple(float(u) for u in range(10, 101, 10) if p.u_range[0] <= u <= p.u_range[1]) or p.u_range
    return Specimen("clutch", at, 10.0, levels, made_of, p)


def table_i(force_n: float) -> Step:
    """Table I at one normal force [N] and 15 RPM; no force, no torque."""
    sigma = Apparatus().stress_kpa(force_n)
    return Step(
        Ts=max(0.0, 0.0944 * sigma - 0.0896) if force_n > 0 else 0.0,
        tau1=6.01 * exp(-0.431 * sigma) + 0.11 * exp(0.0492 * sigma),
        tau2=40.25 * exp(-0.219 * sigma) + 1.37 * exp(0.0476 * sigma),
    )


def table_ii(speed_rpm: float) -> Step:
    """Table II at one speed [RPM] and 86 N, τ2 as this module's head says; a rotor at rest gives no torque."""
    return Step(
        Ts=0.349 * exp(-0.230 * speed_rpm) + 1.042 * exp(0.00608 * speed_rpm) if speed_rpm > 0 else 0.0,
        tau1=0.425 * exp(-0.310 * speed_rpm) + 0.0498 * exp(-0.0150 * speed_rpm),
        tau2=5.4 * exp(-0.0101 * speed_rpm),
    )


# `--plant reference`, by kind: the clutch, the friction rig under weights [N], and at speeds [RPM] under 86 N
REFERENCE: dict[str, Specimen] = {
    "clutch": clutch(),
    "friction-force": Specimen(
        "friction-force", table_i, 15.0, tuple(map(float, range(17, 171, 17))), "Table I as printed", input_unit="N"
    ),
    "friction-speed": Specimen(
        "friction-speed", table_ii, None, tuple(map(float, range(5, 41, 5))),
        "Table II as printed, with tau2 = 5.4 exp(-0.0101 RPM) s", input_unit="RPM",
    ),
}  # fmt: skip


def of_model(fit: Fit, kind: ExperimentKind, named: str) -> Specimen:
    """The plant that a fit found, in its units; of friction only the fitted levels can be recorded."""
    data = fit.data
    input_unit, output_unit = data.input_unit, data.output_unit
    if kind == "clutch":
        model = plant_of(fit)
        if model is None:
            raise DataError(f"{named}: holds no nonlinear model, which is the plant; fit clutch logs with it")
        made = clutch(model, named)
        levels = tuple(u for u in data.levels if model.u_range[0] <= u <= model.u_range[1])
        if data.input_unit == "%" and model.u_range[1] <= 100:
            levels = made.levels if not data.levels or set(made.levels) >= set(levels) else levels
        return replace(made, levels=levels or model.u_range, input_unit=input_unit, output_unit=output_unit)
    if data.kind != kind:
        raise UsageError(f"{named}: is a fit of {data.kind} logs; ask for «kind» {data.kind}")
    rows = [row for row in fit.friction_levels if row.from_ == 0]
    if fit.friction is None or not rows:
        raise DataError(f"{named}: holds no friction levels; fit the friction model first")
    curves = {row.level: Step(row.Ts, row.tau1, row.tau2, fit.friction.C or SHARE) for row in rows}

    def at(value: float) -> Step:
        if value == 0.0:
            return Step(Ts=0.0, tau1=1.0, tau2=1.0)
        if value not in curves:
            known = ", ".join(f"{level:g}" for level in sorted(curves))
            raise UsageError(f"«levels» {value:g}: is not in {named}, which holds {known}")
        return curves[value]

    measured = replace(REFERENCE[kind], at=at, levels=tuple(sorted(curves)), made_of=named)
    return replace(measured, input_unit=input_unit, output_unit=output_unit)
