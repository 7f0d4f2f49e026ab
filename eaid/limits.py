"""What each numeric option may be: one table, and the sentence that refuses the rest.

A limit says what a rig could ever ask for, not what is wise: within it every command ends, with a result or with a
refusal that names the cause. Names are those of the options, with underscores.
"""

import math
from dataclasses import dataclass

from eaid.errors import UsageError

MOST_SAMPLES = 20_000_000
"""Most control samples of one replay."""
MOST_STEPS = 1_000_000_000
"""Most control samples over all drawn plants."""


@dataclass(frozen=True)
class Limit:
    """A closed range; `above`: its lower end is left out; `whole`: whole numbers only."""

    least: float
    most: float
    above: bool = False
    whole: bool = False

    def holds(self, value: float) -> bool:
        """Whether a value lies within; no NaN does."""
        low = value > self.least if self.above else value >= self.least
        return low and value <= self.most and (not self.whole or value == math.floor(value))

    def words(self) -> str:
        """`a number from 0 to 100`."""
        kind = "a whole number" if self.whole else "a number"
        least, most = _shown(self.least), _shown(self.most)
        return f"{kind} above {least}, {most} at most" if self.above else f"{kind} from {least} to {most}"


def _shown(value: float) -> str:
    return str(value) if isinstance(value, int) and abs(value) < 10**17 else f"{value:g}"


LIMITS: dict[str, Limit] = {
    # all commands
    "seed": Limit(0, 2**53 - 1, whole=True),
    # reading
    "rest": Limit(-1e9, 1e9),
    "step_at": Limit(-1e12, 1e12),
    "until": Limit(-1e12, 1e12),
    # fit
    "dead_time": Limit(0, 1e4),
    # tune-rc
    "kp": Limit(-1e10, 1e10),
    "kd": Limit(-1e10, 1e10),
    "natural_frequency": Limit(1e-6, 1e5),
    "damping": Limit(1e-3, 1e3),
    "q_max": Limit(0, 1e9),
    "phi": Limit(0, 1e9),
    "b_hat": Limit(-1e12, 1e12),
    "epsilon": Limit(1e-15, 1e15),
    "gamma": Limit(1e-15, 1e15),
    "p_scale": Limit(1e-9, 1e9),
    "pi_gains": Limit(-1e9, 1e9),
    "pi_overshoot": Limit(-1e6, 1e6),
    "pi_settling": Limit(-1e6, 1e6),
    "duty_limits": Limit(0, 1e9),
    "chatter_limit": Limit(0, 1e9, above=True),
    "evaluations": Limit(15, 100_000, whole=True),
    # tune-rc, simulate and synth
    "rate_hz": Limit(1e-3, 1e5),
    "pwm_hz": Limit(0, 1e6),
    "noise_nm": Limit(0, 1e6),
    "plants": Limit(1, 100_000, whole=True),
    "threads": Limit(1, 1024, whole=True),
    # simulate
    "duration": Limit(0, 1e6, above=True),
    "noise_correlation_s": Limit(0, 1e6),
    "noise_coloured_share": Limit(0, 1),
    "ripple_pct": Limit(0, 1e3),
    "ripple_hz": Limit(0, 1e5),
    "sensor_hz": Limit(0, 1e6),
    "delay_samples": Limit(0, 100_000, whole=True),
    "duty_bits": Limit(0, 32, whole=True),
    "perturb": Limit(0, 1e6, above=True),
    "limb_damping": Limit(0, 1e6),
    "limb_inertia": Limit(1e-6, 1e6),
    # couple
    "torque": Limit(0, 1e6),
    "wall": Limit(0, 1e9, above=True),
    "virtual_damping": Limit(0, 1e6),
    "encoder_counts": Limit(1, 10**9, whole=True),
    "idle_drag_nm": Limit(0, 1e6),
    "rotor_rpm": Limit(0, 1e6),
    "limb_speed_rad_s": Limit(0, 1e6),
    "pair_bias_nm": Limit(0, 1e6, above=True),
    "limb_spread": Limit(0, 0.99),
    # export
    "rate_filter_hz": Limit(0, 1e5, above=True),
    "duty_on_fault": Limit(-1e9, 1e9),
    "stuck_s": Limit(0, 1e4, above=True),
    # synth
    "levels": Limit(0, 1e9, above=True),
    "repeats": Limit(1, 10_000, whole=True),
    "idle": Limit(0, 1e7),
    "hold": Limit(0, 1e7, above=True),
    "release": Limit(0, 1e7),
    "coloured": Limit(0, 10),
    "coloured_s": Limit(0, 1e6),
    "ripple": Limit(0, 10),
    "gain_scatter": Limit(0, 0.3),
    "tau1_scatter": Limit(0, 3),
    "tau2_scatter": Limit(0, 3),
    "offset_nm": Limit(-1e6, 1e6),
    "jitter_s": Limit(0, 1e3),
    "resolution_nm": Limit(0, 1e6),
    # synth, of an excitation
    "duration_s": Limit(0, 1e7, above=True),
    "hold_s": Limit(0, 1e7, above=True),
    "idle_s": Limit(0, 1e7),
    "rest_s": Limit(0, 1e7),
    "frequency_hz": Limit(0, 1e6, above=True),
    "reference_nm": Limit(-1e6, 1e6),
    "gains": Limit(-1e9, 1e9),
    "level_count": Limit(2, 10_000, whole=True),
    "tones": Limit(1, 10_000, whole=True),
    "periods": Limit(1, 1000, whole=True),
    # plan
    "work_s": Limit(0, 1e7),
    "rate_per_s": Limit(0, 1e9),
    "engagements": Limit(1, 1000, whole=True),
    "longest_s": Limit(1, 1e6),
    "longest_hold": Limit(5, 1e6),
    "most_levels": Limit(4, 100, whole=True),
}  # fmt: skip


def fault(name: str, value: float) -> str | None:
    """Why an option may not have this value; None where it may."""
    limit = LIMITS[name]
    if limit.holds(value):
        return None
    shown = f"{value:g}" if isinstance(value, float) else str(value)
    return f"«{name}» {shown[:30]}: give {limit.words()}"


def check(name: str, value: float) -> None:
    """Refuse a value of an option that is out of its limits, with `UsageError`."""
    found = fault(name, value)
    if found is not None:
        raise UsageError(found)


def check_all(**values: float | None) -> None:
    """Refuse every value that is out of its limits, all at once; what is None was not given."""
    faults = faults_of(**values)
    if faults:
        raise UsageError(*faults)


def faults_of(**values: float | None) -> list[str]:
    """Why options may not have these values; what is None was not given."""
    return [found for name, value in values.items() if value is not None and (found := fault(name, value))]
