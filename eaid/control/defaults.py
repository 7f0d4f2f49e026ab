"""The numbers of a design where nothing is said: the paper's, or the rig's own by its units, pace and dead time.

On a rig in % duty and N·m the paper's numbers stand (Table IV, §V). On any other rig the same design is made for the
rig's own scales: its pace s = a0/1.36, 1.36 1/s being the paper's a0, and its top y, the output at the highest input:

    K_P = 4.5 s²,  K_D = 3 s                      the same error dynamics on the rig's own clock
    ε = 0.11 y Q22,  γ = 25/ε                     the boundary layer spans the same share of the output; γε as printed
    Q_M                                           the largest slope of the rig's own multisine, or of the reference
    φ                                             what the model and the logs show
    PI                                            1 % overshoot, 0.27 s/s settling

A loop that is sampled more slowly than the paper's, for its pace, cannot be as stiff: ε and the settling time grow by
half until the loops run, the robust one with 6 dB and 45° around every operating point of the plant; behind a dead time
that the steps show, so does the PI.
"""

from dataclasses import replace
from typing import NamedTuple

from eaid.control.bounds import Bounds, model_of
from eaid.control.margins import Timing, is_stable, linear_lags, margins, pi_feedback, rc_feedback
from eaid.control.operating import enough, keeps_margins, operating_points
from eaid.control.pi import PIGains, pi_gains
from eaid.control.robust import Design, law_of
from eaid.errors import DataError, GainsError, UsageError
from eaid.models.nonlinear import steady_torque
from eaid.models.parameters import PAPER_LINEAR, Linear, Nonlinear
from eaid.options import TuneOptions
from eaid.results.fit import Fit
from eaid.results.gains import AskedPI

PAPER_TOP = 4.372
"""Output of the reference plant at 100 % [N·m]."""
LAYER = 0.11
"""Half width of the paper's boundary layer over the torque at 100 %: ε/(Q22 · 4.37)."""
OVERSHOOT_PCT, SETTLING_S = 1.0, 0.27
"""What the paper's PI was meant to reach (§V-B)."""
SLOWER = 1.5
"""Factor on a settling time, or on ε, that the sampled loop cannot have."""
MOST_STEPS = 30


class Scales(NamedTuple):
    """A rig's own sizes, beside the paper's."""

    paper: bool
    """% duty and N·m: the paper's numbers stand."""
    pace: float
    """a0 over the paper's; 1 on the paper's rig."""
    top: float
    """Output at the highest input, over the reference plant's; 1 on the paper's rig."""


def scales_of(fit: Fit, plant: Nonlinear | None = None) -> Scales:
    """What the rig's clock and output are scaled by."""
    if is_duty(fit) and fit.data.output_unit in ("N·m", "Nm"):
        return Scales(True, 1.0, 1.0)
    pace = fit.linear.a0 / PAPER_LINEAR.a0 if fit.linear is not None and fit.linear.a0 > 0 else 1.0
    return Scales(False, pace, _top(fit, plant) / PAPER_TOP)


def is_duty(fit: Fit) -> bool:
    """Whether the input is a duty cycle in %; levels of up to 1 are rather shares that nobody called so."""
    return fit.data.input_unit == "%" and 1.0 < max(fit.data.levels, default=100.0) <= 100.0


def input_limits(fit: Fit) -> tuple[float, float]:
    """Range of the actuator: 0…100 % of a duty, of another input 0 to what was identified."""
    if is_duty(fit):
        return 0.0, 100.0
    highest = fit.nonlinear.u_range[1] if fit.nonlinear is not None else max(fit.data.levels, default=0.0)
    if not highest > 0:
        raise UsageError(f"the fit tells no highest input in {fit.data.input_unit}; give «duty_limits»")
    return 0.0, highest


def _top(fit: Fit, plant: Nonlinear | None) -> float:
    if plant is not None:
        return float(steady_torque(plant, plant.u_range[1]))
    rows = fit.linear.per_level if fit.linear is not None else ()
    return max((row.gain for row in rows), default=PAPER_TOP)


def timing_of(fit: Fit, options: TuneOptions) -> Timing:
    """When the loop samples and latches: as given, else as the fit's rig does; no PWM where the input is no duty.

    The dead time that the steps show counts as delay.
    """
    rig = fit.data.apparatus
    paper = is_duty(fit)
    rate = options.rate_hz or (rig.sample_rate_hz if paper else fit.data.sample_rate_hz or 1000.0)
    pwm = options.pwm_hz if options.pwm_hz is not None else (rig.pwm_hz if paper else 0.0)
    return Timing(rate, pwm or None, delay_samples=round(fit.dead_time_s * rate))


def design_options(
    fit: Fit, options: TuneOptions, scales: Scales, slope: float | None, phi_shown: float | None
) -> Design:
    """The numbers of a design, from what was said and, where nothing was, from the rig.

    `slope` is the largest of the reference [output/s], `phi_shown` what the data show of |η − η̂| [input].
    """
    K_P = 4.5 * scales.pace**2 if options.kp is None else options.kp
    K_D = 3.0 * scales.pace if options.kd is None else options.kd
    if options.natural_frequency is not None and options.damping is not None:  # s² + K_D s + K_P
        K_P, K_D = options.natural_frequency**2, 2 * options.damping * options.natural_frequency
    if not (K_P > 0 and K_D > 0):
        raise GainsError(
            f"K_P {K_P:g} and K_D {K_D:g} make the error dynamics s² + K_D s + K_P unstable; both have to be positive"
        )
    if not isinstance(options.b_hat, str) and not options.b_hat > 0:
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
    Q22 = (options.p_scale + options.p_scale / K_P) / (2 * K_D)
    own = 0.5 if scales.paper else LAYER * PAPER_TOP * scales.top * Q22
    epsilon = own if options.epsilon is None else options.epsilon
    return Design(
        asked=options, K_P=K_P, K_D=K_D,
        Q_M=options.q_max if options.q_max is not None else 5.0 if slope is None else slope,
        phi=0.05 if options.phi is None or options.phi == "data" else float(options.phi),
        phi_honest_pct=phi_shown if by_data else None,
        epsilon=epsilon,
        gamma=options.gamma if options.gamma is not None else 50.0 if scales.paper else 25.0 / epsilon,
        pi=AskedPI(options.pi_overshoot, options.pi_settling),
        duty_limits_pct=options.duty_limits or input_limits(fit), timing=timing_of(fit, options),
    )  # fmt: skip


def with_own_layer(fit: Fit, design: Design, scales: Scales, bounds: Bounds, plant: Nonlinear | None) -> Design:
    """The design for a rig that is not the paper's with a boundary layer that the sampled loop can have, if any."""
    if scales.paper:
        return design
    asked, model = design, model_of(fit)
    points = operating_points(fit, model, plant, bounds, design.duty_limits_pct)
    for _ in range(MOST_STEPS):
        gains = law_of(model, bounds, design)[0]
        here = rc_feedback(gains, 1.0, (model.a0 - model.c0) / model.b0)
        runs = is_stable(here, linear_lags(model.b0, model.a0), design.timing)
        if runs and keeps_margins(gains, points, design.timing):
            return design
        design = replace(design, epsilon=design.epsilon * SLOWER, gamma=design.gamma / SLOWER)
    return asked


def with_own_pi(fit: Fit, design: Design, scales: Scales) -> Design:
    """The design with a PI for a rig that is not the paper's: slower, where the sampled loop cannot follow."""
    if scales.paper or design.asked.pi_gains is not None or design.pi.overshoot_pct is not None:
        return design
    model = model_of(fit)
    settling = SETTLING_S / scales.pace
    while not _runs(model, settling, design.timing):
        settling *= SLOWER
    return replace(design, pi=AskedPI(OVERSHOOT_PCT, settling))


def _runs(model: Linear, settling_s: float, timing: Timing) -> bool:
    """Whether the sampled loop is stable with a PI of this settling time, behind a dead time with 6 dB and 45°.

    GainsError where none is slow enough.
    """
    K_P, K_I = pi_gains(model, OVERSHOOT_PCT, settling_s)
    feedback, lags = pi_feedback(PIGains(K_P, K_I)), linear_lags(model.b0, model.a0)
    return enough(margins(feedback, lags, timing)) if timing.delay_samples else is_stable(feedback, lags, timing)
