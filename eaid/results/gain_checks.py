"""What is known of gains beyond the gains: the actuator, what φ has to be, margins, what was replayed and searched.

Units are the rig's; `_nm` and `_pct` in a key say what they are on the paper's rig.
"""

from eaid.results.common import Count, Number, Positive, Result


class TorquePoint(Result, frozen=True):
    """How much of ±ρ the actuator can deliver at one torque."""

    torque_nm: Number
    eta_hat_pct: Number | None = None
    share_up: Number | None = None
    share_down: Number | None = None


class Actuator(Result, frozen=True):
    """What the robust term asks for and what the actuator spans, in the input's unit."""

    robust_term_pct: Number | None = None
    span_pct: Number | None = None
    points: tuple[TorquePoint, ...] = ()


class Mismatch(Result, frozen=True):
    """Largest |η − η̂| that one source shows, in the input's unit."""

    pct: Number
    signed_pct: Number | None = None
    where: str = ""


class PhiFromData(Result, frozen=True):
    """Largest |η − η̂| by source."""

    model: Mismatch | None = None
    logs: Mismatch | None = None
    levels: Mismatch | None = None


class SampleTiming(Result, frozen=True):
    """Rate of the controller, and the PWM that latches the duty."""

    rate_hz: Positive = 1000.0
    pwm_hz: Positive | None = None
    delay_samples: Count = 0
    """Dead time that the steps show."""


class Margin(Result, frozen=True):
    """Margins of one loop."""

    stable: bool | None = None
    gain_db: Number | None = None
    delay_s: Number | None = None
    phase_deg: Number | None = None
    crossover_hz: Number | None = None


class MarginPoint(Result, frozen=True):
    """Margins of both loops around one held duty."""

    duty_pct: Number
    torque_nm: Number | None = None
    rc: Margin | None = None
    pi: Margin | None = None


class WorstMargins(Result, frozen=True):
    """The least of each margin over all points."""

    rc: Margin | None = None
    pi: Margin | None = None


class Margins(Result, frozen=True):
    """Margins of both loops, sampled and latched as `timing` says."""

    timing: SampleTiming = SampleTiming()
    points: tuple[MarginPoint, ...] = ()
    worst: WorstMargins | None = None


class Tracking(Result, frozen=True):
    """Errors of one replay: reference − true output, from `counted_from_s` on."""

    max_abs_error_nm: Number | None = None
    rms_error_nm: Number | None = None
    mean_abs_error_nm: Number | None = None
    iae_nm_s: Number | None = None
    mean_abs_duty_step_pct: Number | None = None
    saturated_fraction: Number | None = None


class Candidate(Result, frozen=True):
    """One candidate of the search, and what it did on the drawn plants."""

    p_scale: Number
    epsilon: Number
    phi_honest_pct: Number
    B_hat: Number
    K_P: Number
    K_D: Number
    equal_pi: tuple[Number, Number]
    rms_error_nm: Number
    """Over all plants and counted samples."""
    worst_plant_rms_error_nm: Number
    max_abs_error_nm: Number
    mean_abs_duty_step_pct: Number
    saturated_fraction: Number


class Optimized(Result, frozen=True):
    """What the search began with, and what it ended at."""

    reference: str
    plants: Count
    noise_nm: Number
    noise_source: str
    """given, logs, fit, or supposed."""
    limit_pct: Number
    """Most chattering allowed, in the input's unit per sample."""
    before: Candidate
    after: Candidate


class Replayed(Result, frozen=True):
    """Errors on the standard reference."""

    reference: str = ""
    slope_nm_s: Number | None = None
    counted_from_s: Number | None = None
    rc: Tracking | None = None
    pi: Tracking | None = None
