"""What an export is made from: gains and fit as typed results, or the plain gains and plant that a script holds."""

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
from eaid.results.gain_checks import Margins
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
    def margins(self) -> Margins | None:
        """Margins of the loops, where the gains hold any."""
        return self.gains.margins if self.gains else None

    @property
    def top(self) -> float:
        """Largest torque of the rig, for test vectors."""
        if self.plant is not None:
            return plant_terms(plant_parameters(self.plant), self.plant.u_range[1])[2] or 1.0
        if self.linear is not None:
            a0, b0, c0 = self.linear
            return max((b0 * self.limits[1] + c0) / a0, 1e-3)
        return 1.0


def source_of(gains: Gains | RCGains | PIGains | None, plant_or_fit: Fit | Nonlinear | None) -> Source:
    """Both in plain types; UsageError where there is neither."""
    if gains is None and plant_or_fit is None:
        raise UsageError("nothing to export: give gains, or a fit with a nonlinear model")
    source = _with_gains(gains)
    if isinstance(plant_or_fit, Nonlinear):
        return replace(source, plant=plant_or_fit)
    return _with_fit(source, plant_or_fit) if plant_or_fit is not None else source


def _with_gains(gains: Gains | RCGains | PIGains | None) -> Source:
    if isinstance(gains, RCGains):
        limits, linear = (gains.duty_min, gains.duty_max), (gains.a0, gains.b0, gains.c0)
        return Source(rc=gains, limits=limits, linear=linear)
    if isinstance(gains, PIGains):
        return Source(pi=gains, limits=(gains.duty_min, gains.duty_max))
    if gains is None:
        return Source()
    model = gains.model
    timing = gains.margins.timing if gains.margins else None
    return Source(
        rc=rc_gains(gains), pi=pi_gains(gains), linear=(model.a0, model.b0, model.c0), limits=gains.duty_limits_pct,
        units=(gains.input_unit, gains.output_unit), rate_hz=timing.rate_hz if timing else 1000.0,
        pwm_hz=timing.pwm_hz if timing else None, gains=gains,
        origins=(f"gains: digest {digest_of(content_of(gains, 'gains'))}",),
    )  # fmt: skip


def _with_fit(source: Source, fit: Fit) -> Source:
    units, limits, rate = source.units, source.limits, source.rate_hz
    if source.gains is None or units == ("%", "N·m"):
        units = (fit.data.input_unit, fit.data.output_unit)
    if source.gains is None:
        rate = fit.data.sample_rate_hz or rate
        limits = input_limits(fit)
    origins = (*source.origins, f"fit: digest {digest_of(content_of(fit, 'fit'))}")
    return replace(source, plant=plant_of(fit), fit=fit, units=units, limits=limits, rate_hz=rate, origins=origins)
