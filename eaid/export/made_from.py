"""What an export is made from: the controllers of gains and the plant of a fit, with their units and origins."""

from dataclasses import dataclass, replace

from eaid.control.defaults import input_limits
from eaid.control.gains import pi_gains, rc_gains
from eaid.control.pi import PIGains
from eaid.control.plant import plant_of
from eaid.control.rc import RCGains
from eaid.errors import UsageError
from eaid.models.parameters import Nonlinear
from eaid.replay.plant import plant_parameters, plant_terms
from eaid.results.codec import content_of, digest_of
from eaid.results.fit import Fit
from eaid.results.gains import Gains


@dataclass(frozen=True)
class Source:
    """Gains and plant in plain types, with their units and what is known of them."""

    rc: RCGains | None = None
    pi: PIGains | None = None
    plant: Nonlinear | None = None
    linear: tuple[float, float, float] | None = None
    """a0, b0, c0 of the linear model."""
    limits: tuple[float, float] = (0.0, 100.0)
    units: tuple[str, str] = ("%", "N·m")
    rate_hz: float = 1000.0
    pwm_hz: float | None = None
    origins: tuple[str, ...] = ()
    """What the numbers came from, with a fingerprint each."""
    gains: Gains | None = None
    fit: Fit | None = None

    @property
    def laws(self) -> tuple[str, ...]:
        """The laws that can be exported."""
        held = (("pi", self.pi), ("rc", self.rc), ("inverse", self.plant), ("plant", self.plant))
        return tuple(name for name, value in held if value is not None)

    @property
    def top(self) -> float:
        """Largest torque of the rig, for test vectors."""
        if self.plant is not None:
            return plant_terms(plant_parameters(self.plant), self.plant.u_range[1])[2] or 1.0
        if self.linear is not None:
            a0, b0, c0 = self.linear
            return max((b0 * self.limits[1] + c0) / a0, 1e-3)
        return 1.0


def source_of(gains: Gains | None, fit: Fit | None) -> Source:
    """Both in plain types; UsageError where there is neither."""
    if gains is not None:
        source = _of_gains(gains)
    elif fit is not None:
        source = Source(limits=input_limits(fit), rate_hz=fit.data.sample_rate_hz or 1000.0)
    else:
        raise UsageError("nothing to export: give gains, or a fit with a nonlinear model")
    if fit is None:
        return source
    units = (fit.data.input_unit, fit.data.output_unit) if source.units == ("%", "N·m") else source.units
    origins = (*source.origins, f"fit: digest {digest_of(content_of(fit, 'fit'))}")
    return replace(source, plant=plant_of(fit), fit=fit, units=units, origins=origins)


def _of_gains(gains: Gains) -> Source:
    timing = gains.margins.timing if gains.margins else None
    return Source(
        rc=rc_gains(gains), pi=pi_gains(gains), linear=(gains.model.a0, gains.model.b0, gains.model.c0),
        limits=gains.duty_limits_pct, units=(gains.input_unit, gains.output_unit),
        rate_hz=timing.rate_hz if timing else 1000.0, pwm_hz=timing.pwm_hz if timing else None, gains=gains,
        origins=(f"gains: digest {digest_of(content_of(gains, 'gains'))}",),
    )  # fmt: skip
