"""The numbers of a design where nothing is said: the paper's, or the rig's own by its units, pace and dead time.

On a rig in % duty and N·m, up to four times as quick or slow as the paper's, the paper's numbers stand (Table IV, §V).
On any other rig the same design is made for the rig's own scales: its pace s = a0/1.36, 1.36 1/s being the paper's a0,
and its top y, the output at the highest input:

    K_P = 4.5 s²,  K_D = 3 s                      the same error dynamics on the rig's own clock
    ε = 0.11 y Q22,  γ = 25/ε                     the boundary layer spans the same share of the output; γε as printed
    Q_M                                           the largest slope of the rig's own multisine, or of the reference
    φ                                             what the model and the logs show

The PI of every rig, the paper's too: 1 % overshoot on the linear model, settling within 0.27 s/s, a time that grows by
half until the loop has 6 dB and 45° around every operating point of the plant as it runs, sampled, latched and behind
its dead time, and in smaller steps until it has them with the largest gain that the rig may have there; where the
linear model knows no slower one, no overshoot, K_I = a0 K_P.

The robust loop of a rig that is not the paper's, or has a dead time, has these margins too: ε grows by half until it
has, and where no ε does, K_P and K_D give way to those of half the PI's gains around rest. On the paper's rig its
numbers stand wherever the loop is stable.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import msgspec
import numpy as np

from eaid.apparatus import Apparatus
from eaid.control.design import Design, robust_of
from eaid.control.gains import RangeOfB
from eaid.control.kinds import Law, rc_law
from eaid.control.margins import ENOUGH_DB, ENOUGH_DEG, Point, holds
from eaid.control.pi import PIGains, pi_gains
from eaid.errors import DataError, GainsError, UsageError
from eaid.findings import Finding, finding
from eaid.options import TuneOptions
from eaid.plant.dynamics import Plant
from eaid.plant.linear import PAPER_LINEAR, LinearPlant
from eaid.results.fit import Fit
from eaid.results.gains import AskedPI, Timing

PAPER_TOP = 4.372  # Output of the reference plant at 100 % [N·m]
LAYER = 0.11  # Half width of the paper's boundary layer over the torque at 100 %: ε/(Q22 · 4.37)
OVERSHOOT_PCT, SETTLING_S = 1.0, 0.27  # What the paper's PI was meant to reach (§V-B)
SLOWER = 1.5  # Factor on a settling time, or on ε, that the sampled loop cannot have
SLIGHTLY = SLOWER**0.25  # The same where only a gain larger than the fitted one keeps the loop from its margins
MOST_BISECTIONS = 40
PAPERS_PACE = 4.0  # Factor by which a rig may be quicker or slower than the paper's, and have its numbers
PARTS_OF_PI = (0.5, 0.25, 0.1)  # Of the PI's slopes, that an RC is given in turn where its own are too quick
LONG = 1.0  # Dead time over 1/a0 beyond which there is no robust controller


class Scales(NamedTuple):
    """A rig's own sizes, beside the paper's."""

    paper: bool  # % duty and N·m: the paper's numbers stand
    pace: float  # a0 over the paper's; 1 on the paper's rig
    top: float  # Output at the highest input, over the reference plant's; 1 on the paper's rig


def scales_of(fit: Fit, plant: Plant | None = None) -> Scales:
    """What the rig's clock and output are scaled by; the paper's numbers are for a clutch that neither rings, nor
    overshoots, nor has its lags in series."""
    papers = plant is None or plant.kind in ("parallel", "lag")
    pace = fit.linear.a0 / PAPER_LINEAR.a0 if fit.linear is not None and fit.linear.a0 > 0 else 1.0
    near = plant is None or 1 / PAPERS_PACE <= pace <= PAPERS_PACE
    if papers and near and is_duty(fit) and fit.data.output_unit in ("N·m", "Nm"):
        return Scales(True, 1.0, 1.0)
    rows = fit.linear.per_level if fit.linear is not None else ()
    top = max((row.gain for row in rows), default=PAPER_TOP)
    if plant is not None:
        top = float(plant.steady(plant.u_range[1]))
    return Scales(False, pace, top / PAPER_TOP)


MOST_DUTY = 101.0  # That a duty of 100 % is read back as, at most


def is_duty(fit: Fit) -> bool:
    """Whether the input is a duty cycle in %; levels of up to 1 are rather shares that nobody called so."""
    return fit.data.input_unit == "%" and 1.0 < max(fit.data.levels, default=100.0) <= MOST_DUTY


def of_this_mounting(fit: Fit, what: str) -> list[Finding]:
    """Said wherever the fit of a single session is used: `what` holds for its mounting."""
    return [] if fit.of_sessions else [finding("for-this-mounting", "model", what=what)]


def counted_from_rest(fit: Fit, limits: tuple[float, float]) -> list[Finding]:
    """Said wherever an input goes to a rig, or comes from one, that rests at another one than 0."""
    rest, (low, high), unit = float(fit.options.reading.get("rest") or 0.0), limits, fit.data.input_unit
    if not rest:
        return []
    on_rig = {"rig_low": rest + low, "rig_high": rest + high}
    return [finding("input-from-rest", "model", (), rest=rest, unit=unit, low=low, high=high, **on_rig)]


def input_limits(fit: Fit) -> tuple[float, float]:
    """Range of the actuator: 0…100 % of a duty, of another input 0 to what was identified; of both signs where it was
    recorded so."""
    signed = fit.plant_ is not None and bool(fit.plant_.Ts_below)
    if is_duty(fit):
        return (-100.0 if signed else 0.0), 100.0
    if fit.plant_ is not None:
        top = fit.plant_.u_range[1]
        if not signed:
            return 0.0, top
        driven = [u for log in fit.logs if log.curve is not None for u in log.curve.input] or [-top, top]
        return max(-top, min(driven)), min(top, max(driven))
    highest = fit.nonlinear.u_range[1] if fit.nonlinear is not None else max(fit.data.levels, default=0.0)
    if not highest > 0:
        raise UsageError(f"the fit tells no highest input in {fit.data.input_unit}; give «duty_limits»")
    return 0.0, highest


LEAST_SAMPLES = 20  # Samples in the shortest lag of a slow rig, at least
FAST_SAMPLES = 12  # Samples in the linear model's lag of a fast one, at least
QUICK_PWM = 20  # Periods of a PWM in a sample from which its latch adds nothing


def control_rate(fit: Fit) -> float:
    """Rate of the controller [Hz] where nothing is said: 1 kHz, whatever the logger's, on a fast rig more, with so many
    samples in the lag of the linear model; on a rig slower than the paper's in proportion to its pace, with so many
    in its shortest lag."""
    held = fit.plant_ is not None or fit.nonlinear is not None
    pace, rate = scales_of(fit, fit.plant if held else None).pace, (fit.data.apparatus or Apparatus()).sample_rate_hz
    if pace >= 1:
        return max(rate, float(f"{FAST_SAMPLES * pace * PAPER_LINEAR.a0:.2g}"))
    least = 0.0
    if held:
        plant = fit.plant
        shortest = plant.time_constants(np.array(plant.u_range))[0].min()
        least = LEAST_SAMPLES / max(float(shortest), plant.floor_s)
    return min(rate, float(f"{max(rate * pace, least):.2g}"))


def timing_of(fit: Fit, options: TuneOptions) -> Timing:
    """When the loop samples and latches: as given, else as the fit's rig does (no PWM where the input is no duty), the
    dead time at its upper end as delay."""
    rate, pwm = options.rate_hz or control_rate(fit), options.pwm_hz
    if pwm is None:
        latched_hz = (fit.data.apparatus or Apparatus()).pwm_hz
        pwm = latched_hz if is_duty(fit) and latched_hz < QUICK_PWM * rate else 0.0
    return Timing(rate, pwm or None, delay_samples=fit.latest_dead_time_s * rate)


def design_options(
    fit: Fit, options: TuneOptions, scales: Scales, slope: float | None, phi_shown: float | None
) -> Design:
    """The numbers of a design, from the options and, where they are silent, from the rig; `slope` is the largest of the
    reference [output/s], `phi_shown` what the data show of |η − η̂| [input]."""
    K_P = 4.5 * scales.pace**2 if options.kp is None else options.kp
    K_D = 3.0 * scales.pace if options.kd is None else options.kd
    if options.natural_frequency is not None and options.damping is not None:  # s² + K_D s + K_P
        K_P, K_D = options.natural_frequency**2, 2 * options.damping * options.natural_frequency
    if not (K_P > 0 and K_D > 0):
        raise GainsError(
            f"K_P {K_P:g} and K_D {K_D:g} make the error dynamics s² + K_D s + K_P unstable; both have to be positive"
        )
    if isinstance(options.b_hat, float) and not options.b_hat > 0:
        raise GainsError(f"B̂ is {options.b_hat:g} %·s/(N·m); it has to be positive, or the loop is turned round")
    by_data = options.phi == "data" or (options.phi is None and not scales.paper)
    if by_data and phi_shown is None:
        raise DataError(
            "the fit holds neither a nonlinear model nor fits of single levels, so there is nothing to take φ "
            "from; give «phi»"
        )
    if options.duty_limits is not None and is_duty(fit) and options.duty_limits[1] > 100:
        low, high = options.duty_limits
        raise UsageError(f"«duty_limits» {low:g},{high:g}: a duty ends at 100 %")
    own = options.kp is None and options.natural_frequency is None  # else P is p·I
    P = (options.p_scale * (scales.pace**2 if own else 1.0), options.p_scale)
    Q22 = (P[1] + P[0] / K_P) / (2 * K_D)
    layer = 0.5 if scales.paper else LAYER * PAPER_TOP * scales.top * Q22
    epsilon = layer if options.epsilon is None else options.epsilon
    return Design(
        options=options, K_P=K_P, K_D=K_D,
        Q_M=options.q_max if options.q_max is not None else 5.0 if slope is None else slope,
        phi=0.05 if options.phi is None or options.phi == "data" else float(options.phi),
        phi_honest_pct=phi_shown if by_data else None,
        epsilon=epsilon, P=P,
        gamma=options.gamma if options.gamma is not None else 50.0 if scales.paper else 25.0 / epsilon,
        pi=AskedPI(options.pi_overshoot, options.pi_settling),
        duty_limits_pct=options.duty_limits or input_limits(fit), timing=timing_of(fit, options),
    )  # fmt: skip


def slower_by(law: Law, points: Sequence[Point], timings: Sequence[Timing], *least: float) -> float:
    """The factor by which a loop is to be tried slower, for its margins around every point; 1 where it has them."""
    if not all(holds(law, point, each, *least) for each in timings for point in points):
        return SLOWER
    steepest = [point.steepest for point in points if point.times > 1]
    return 1.0 if all(holds(law, point, each, *least) for each in timings for point in steepest) else SLIGHTLY


def quickest(
    model: LinearPlant, points: Sequence[Point], timing: Timing, pace: float,
    law: Callable[[float, float], Law] = PIGains, wrong: tuple[float, ...] = (1.0,),
) -> AskedPI | None:  # fmt: skip
    """The quickest PI that has, as a law takes it, 6 dB and 45° around every operating point, the dead time times each
    factor in turn; None where there is none."""
    timings = [msgspec.structs.replace(timing, delay_samples=each * timing.delay_samples) for each in wrong]
    for overshoot_pct in (OVERSHOOT_PCT, 0.0):
        settling_s = SETTLING_S / pace
        for _ in range(MOST_BISECTIONS):
            try:
                pi = law(*pi_gains(model, overshoot_pct, settling_s))
            except GainsError:  # slower than integral control alone
                break
            if (factor := slower_by(pi, points, timings)) == 1:
                return AskedPI(overshoot_pct, settling_s)
            settling_s *= factor
    return None


def quickest_pi(model: LinearPlant, points: Sequence[Point], timing: Timing, pace: float, unit: str) -> AskedPI:
    """The quickest PI; GainsError where there is none."""
    if (found := quickest(model, points, timing, pace)) is not None:
        return found
    flat = dict.fromkeys(point.duty_pct for point in points if point.plant.gain <= 0)
    why = f"the output does not rise with the input around {', '.join(f'{u:.4g}' for u in flat)} {unit}: leave such "
    why += "levels out of the fit («levels», of logs fitted as recorded «duty»)"
    raise GainsError(
        f"no PI has {ENOUGH_DB:g} dB and {ENOUGH_DEG:g}° around every level, {timing.words()}; "
        + (why if flat else "record more levels, or give «pi_gains»")
    )


def beyond_rc(model: LinearPlant, timing: Timing, options: TuneOptions) -> str | None:
    """Why there is no robust controller; None where there is one, or where its layer or poles are given."""
    given = (options.kp, options.kd, options.natural_frequency, options.epsilon, options.gamma)
    if timing.delay_s * model.a0 <= LONG or any(one is not None for one in given):
        return None
    return (
        f"none behind a dead time of {timing.delay_s:.3g} s, longer than 1/a0, {1 / model.a0:.3g} s: it would hold the "
        "output that was, in a layer wider than any error; take pi or smith, or give «epsilon»"
    )


def workable_rc(
    model: LinearPlant, design: Design, scales: Scales, bounds: RangeOfB, points: Sequence[Point], pi: PIGains
) -> Design:
    """The design with a boundary layer, and if need be K_P and K_D, that the loop can have; as it is where none is."""
    options, timing = design.options, design.timing
    if options.epsilon is not None or options.gamma is not None:
        return design
    papers = scales.paper and not timing.delay_samples
    least = (0.0, -180.0) if papers else (ENOUGH_DB, ENOUGH_DEG)  # its numbers stand wherever the loop is stable
    tried = [design]
    if pi.K_I and not papers and options.kp is None and options.kd is None and options.natural_frequency is None:
        B_hat = robust_of(model, bounds, design).B_hat
        for part in PARTS_OF_PI:
            K_D = (part * pi.K_P + model.a0 / model.b0) / B_hat
            tried.append(replace(design, K_P=part * pi.K_I / B_hat, K_D=K_D))
    for one in tried:
        wider = one
        for _ in range(MOST_BISECTIONS):
            law = rc_law(model, robust_of(model, bounds, wider), wider.duty_limits_pct)
            if (factor := slower_by(law, points, [timing], *least)) == 1:
                return wider
            wider = replace(wider, epsilon=wider.epsilon * factor, gamma=wider.gamma / factor)
    return design


def pi_of(model: LinearPlant, settled: Design) -> PIGains:
    """The PI that was asked for or settled on; GainsError where it is out of reach."""
    given = settled.options.pi_gains
    if given is None:
        assert settled.pi.overshoot_pct is not None and settled.pi.settling_s is not None
        given = pi_gains(model, settled.pi.overshoot_pct, settled.pi.settling_s)
    K_P, K_I = given
    if not (K_P >= 0 and K_I >= 0 and K_P + K_I > 0):
        raise GainsError(f"PI gains {K_P:g} and {K_I:g}: neither may be negative, nor both 0")
    return PIGains(K_P, K_I, *settled.duty_limits_pct)
