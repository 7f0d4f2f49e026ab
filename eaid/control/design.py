"""A fit and settled numbers → gains: the law, the verdict on it, PI, margins, and how far η is from η̂ by the data."""

import itertools
import math
from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from eaid.arrays import Array
from eaid.control.gains import Bounds, model_of
from eaid.control.margins import ENOUGH_DB, ENOUGH_DEG, LoopMargins, Point, known, loop_margins
from eaid.control.pi import PIGains, pi_gains, step_metrics
from eaid.control.robust import Design, law_of
from eaid.errors import GainsError
from eaid.findings import Finding, finding, ranked
from eaid.models.nonlinear import steady_torque, time_constants
from eaid.models.parameters import Linear, Nonlinear
from eaid.results.fit import Fit, LinearLevel
from eaid.results.gains import (
    PI,
    Actuator,
    AskedPI,
    Condition,
    Gains,
    Guarantee,
    LinearModel,
    Margin,
    MarginPoint,
    Margins,
    Mismatch,
    PhiFromData,
    Robust,
    SampleTiming,
    WorstMargins,
)

WITHIN = 1e-9  # Share by which the needed may exceed the available: rounding


DUTIES = 19
INSTANTS = 200


def distance(left_pct: Array, slope: Array, B_m: float, B_M: float) -> Array:
    """Signed distance of u − η̂(T) [% duty] from B Ṫ over B in [B_m, B_M]; slope in N·m/s, shapes alike."""
    low, high = np.minimum(B_m * slope, B_M * slope), np.maximum(B_m * slope, B_M * slope)
    return np.maximum(left_pct - high, 0.0) + np.minimum(left_pct - low, 0.0)


def shown_by_model(plant: Nonlinear, model: Linear, B_m: float, B_M: float, unit: str = "%") -> Mismatch:
    """Over the nonlinear model's steps between identified duties and from rest."""
    duties = np.linspace(*plant.u_range, DUTIES)
    tau1, tau2 = time_constants(plant, duties)
    steady = steady_torque(plant, duties)
    shown = []
    for duty, fast, slow, end in zip(duties, tau1, tau2, steady, strict=True):
        t = np.concatenate([[0.0], np.geomspace(1e-3, 5 * slow, INSTANTS)])
        first, second = np.exp(-t / fast), np.exp(-t / slow)
        start = np.concatenate([[0.0], steady])[:, None]
        torque = end + (start - end) * (plant.C * first + (1 - plant.C) * second)
        slope = (end - start) * (plant.C / fast * first + (1 - plant.C) / slow * second)
        apart = distance(duty - (model.a0 * torque - model.c0) / model.b0, slope, B_m, B_M)
        i, k = np.unravel_index(np.abs(apart).argmax(), apart.shape)
        origin = "rest" if i == 0 else f"{duties[i - 1]:.3g} {unit}"
        shown.append((float(apart[i, k]), f"{t[k]:.3g} s after a step from {origin} to {duty:.3g} {unit}"))
    return _largest(shown)


def _largest(shown: list[tuple[float, str]]) -> Mismatch:
    """The largest of signed mismatches and where they are; none where nothing is shown."""
    value, where = max(shown, key=lambda each: abs(each[0]), default=(0.0, ""))
    return Mismatch(abs(value), value, where if value else "")


def shown_by_levels(per_level: Sequence[LinearLevel], model: Linear, torque_max_nm: float, unit: str = "%") -> Mismatch:
    """Over the single levels' first-order models from 0 to a torque [N·m]; linear in T, so one end is the worst."""
    shown = []
    for row, torque in itertools.product(per_level, (0.0, torque_max_nm)):
        eta = torque * row.level / row.gain
        where = f"at an output of {torque:.3g} on the model of {row.level:.4g} {unit} alone"
        shown.append((eta - (model.a0 * torque - model.c0) / model.b0, where))
    return _largest(shown)


SHARP = 5.0  # γε below which the printed switch, Eq. (14), visibly jumps at z = 0


def design(
    fit: Fit, settled: Design, bounds: Bounds, plant: Nonlinear | None, points: Sequence[Point],
    shown: Mapping[str, Mismatch], slope_nm_s: float, reference: str, given: bool,
) -> Gains:  # fmt: skip
    """Gains for a fit, with everything that is known about them.

    `points` are the operating points of the plant, `found` is what shows how far η is from η̂, `slope_nm_s` the largest
    slope of a reference [N·m/s], which Q_M has to cover where it was given. Raises GainsError where the wishes are not
    physical, out of reach, or a loop is unstable around an operating point.
    """
    model, unit, timing = model_of(fit), fit.data.input_unit, settled.timing
    law, rc = law_of(model, bounds, settled)
    need, phi, Q_M = least_phi(shown), rc.phi_honest_pct, settled.Q_M
    rc = msgspec.structs.replace(
        rc, phi_holds=None if need is None or phi is None else bool(need.pct <= phi * (1 + WITHIN)),
        phi_needed_pct=None if need is None else need.pct,
        Q_M_holds=bool(slope_nm_s <= Q_M * (1 + WITHIN)) if given else None,
        reference_slope_nm_s=slope_nm_s if given else None,
    )  # fmt: skip
    pi = pi_of(model, settled)
    overshoot_pct, settling_s = step_metrics(model, pi.K_P, pi.K_I)
    part = PI(
        pi.K_P, pi.K_I, overshoot_pct, known(settling_s), asked=None if settled.pi == AskedPI() else settled.pi
    )  # fmt: skip
    loops = {name: list(loop_margins(each, points, timing)) for name, each in (("rc", law), ("pi", pi))}
    for name, each in loops.items():
        unstable = [f"{point.duty_pct:.4g}" for point, one in zip(points, each, strict=True) if not one.stable]
        if unstable:
            raise GainsError(
                f"the {name.upper()} loop is unstable on the fitted model around {', '.join(unstable)} {unit}, "
                f"{timing.words()}; ask for slower gains"
            )
    reach = Actuator(law.B_hat * law.rho_constant, law.duty_max - law.duty_min)
    slope = slope_nm_s if given or plant is not None else None  # a slope that nothing follows says nothing
    verdict = _guarantee(rc, slope, reach.robust_term_pct, reach.span_pct, fit)
    rows = [
        MarginPoint(point.duty_pct, point.torque_nm, *map(_margin, each))
        for point, *each in zip(points, *loops.values(), strict=True)
    ]
    missed = []
    for name, each in loops.items():
        lacking = {point.duty_pct: one for point, one in zip(points, each, strict=True) if not one.enough}
        if lacking:
            least = _least(list(lacking.values()))
            missed.append(
                finding("margin-missed", name, list(lacking), unit=unit, enough_db=ENOUGH_DB, enough_deg=ENOUGH_DEG,
                        gain_db=least.gain_db, phase_deg=least.phase_deg)
            )  # fmt: skip
    return Gains(
        model=LinearModel(model.a0, model.b0, model.c0), rc=rc, pi=part, input_unit=unit,
        output_unit=fit.data.output_unit, duty_limits_pct=settled.duty_limits_pct, guarantee=verdict, actuator=reach,
        phi_from_data=PhiFromData(**shown),
        margins=Margins(
            SampleTiming(timing.rate_hz, timing.pwm_hz, timing.delay_samples), tuple(rows),
            WorstMargins(*map(_least, loops.values())),
        ),
        findings=ranked([*_warnings(rc, verdict, need, unit, "reference" if given else reference), *missed]),
    )  # fmt: skip


def pi_of(model: Linear, settled: Design) -> PIGains:
    """The PI that was asked for or settled on; GainsError where it is out of reach."""
    given = settled.options.pi_gains
    if given is None:
        assert settled.pi.overshoot_pct is not None and settled.pi.settling_s is not None
        given = pi_gains(model, settled.pi.overshoot_pct, settled.pi.settling_s)
    K_P, K_I = given
    if not (K_P >= 0 and K_I >= 0 and K_P + K_I > 0):
        raise GainsError(f"PI gains {K_P:g} and {K_I:g}: neither may be negative, nor both 0")
    return PIGains(K_P, K_I, *settled.duty_limits_pct)


def _margin(loop: LoopMargins) -> Margin:
    """As gains.json has it: a margin without end is not known."""
    return Margin(loop.stable, *(known(x) for x in (loop.gain_db, loop.phase_deg, loop.crossover_hz)))


def _least(loops: Sequence[LoopMargins]) -> Margin:
    least = {name: known(min(getattr(one, name) for one in loops)) for name in ("gain_db", "phase_deg")}
    return Margin(stable=True, **least)


def mismatches(model: Linear, bounds: Bounds, plant: Nonlinear | None, unit: str = "%") -> dict[str, Mismatch]:
    """What shows how far η is from η̂: nonlinear model, single levels; those that the fit holds."""
    shown = {}
    if plant is not None:
        shown["model"] = shown_by_model(plant, model, bounds.B_m, bounds.B_M, unit)
    if bounds.rows:
        shown["levels"] = shown_by_levels(bounds.rows, model, max(row.gain for row in bounds.rows), unit)
    return shown


def least_phi(by_source: Mapping[str, Mismatch]) -> Mismatch | None:
    """The φ that the data ask for: by the nonlinear model; by the single levels where there is none."""
    return by_source.get("model", by_source.get("levels"))


def _guarantee(rc: Robust, slope: float | None, needed_pct: float | None, span: float | None, fit: Fit) -> Guarantee:
    """Everything that the argument needs; it holds where every condition does, and cannot be told where none fails and
    one is not known."""
    unit, out = fit.data.input_unit, fit.data.output_unit
    conditions = [
        Condition("rho", rc.guaranteed, None if rc.rho.needed is None else rc.rho.needed.constant, rc.rho.constant,
                  f"{out}/s"),
    ]  # fmt: skip
    for name, needed, available, in_unit in (
        ("phi", rc.phi_needed_pct, rc.phi_honest_pct, unit),
        ("Q_M", slope, rc.Q_M, f"{out}/s"),
        ("duty-limit", needed_pct, span, unit),
    ):
        holds = None if needed is None or available is None else bool(needed <= available * (1 + WITHIN))
        conditions.append(Condition(name, holds, needed, available, in_unit))
    if fit.dead_time_s > 0:
        conditions.append(Condition("dead-time", False, 0.0, fit.dead_time_s, "s"))
    verdicts = [each.holds for each in conditions]
    return Guarantee(False if False in verdicts else None if None in verdicts else True, tuple(conditions))


def _warnings(rc: Robust, verdict: Guarantee, need: Mismatch | None, unit: str, reference: str) -> list[Finding]:
    findings, sharpness = [], rc.gamma * rc.epsilon
    duty_limit, steep = ({each.name: each for each in verdict.conditions}[name] for name in ("duty-limit", "Q_M"))
    if steep.holds is False:
        findings.append(finding("slope-above-q-max", "rc", slope=steep.needed, Q_M=rc.Q_M, reference=reference))
    if not rc.guaranteed:
        findings.append(finding("rho-not-covered", "rc", B_hat=rc.B_hat, reached=rc.alpha_reached, made=rc.rho.alpha))
    if rc.phi_holds is False and need is not None:
        findings.append(
            finding("phi-exceeded", "rc", allowed=rc.phi_honest_pct, needed=need.pct, where=need.where, unit=unit)
        )
    if sharpness < SHARP:
        findings.append(finding("switch-jumps", "rc", sharpness=sharpness, least=SHARP, jump=1 - math.tanh(sharpness)))
    if rc.ultimate_bound is not None and rc.ultimate_bound.torque_error_nm is None:
        findings.append(finding("no-ultimate-bound", "rc"))
    if duty_limit.holds is False:
        findings.append(
            finding("robust-term-beyond-actuator", "rc", asked=duty_limit.needed, span=duty_limit.available, unit=unit)
        )
    return findings
