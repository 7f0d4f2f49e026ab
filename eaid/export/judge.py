"""What a user of an export has to know, and what is not handed on: unstable loops, results marked stop."""

from collections.abc import Iterator

from eaid.control.bounds import Bounds
from eaid.control.margins import Feedback, is_stable, pi_feedback, rc_feedback
from eaid.control.operating import Points, operating_points
from eaid.control.timing import Timing
from eaid.errors import GainsError
from eaid.export.made_from import Source
from eaid.export.options import ExportOptions
from eaid.findings import Finding, finding, ranked, say, stops
from eaid.models.parameters import Linear
from eaid.results.fit import Fit

OF_THE_PLANT = ("data", "nonlinear", "release", "logs")
"""Subjects of a fit's findings that concern its plant."""


def judged(source: Source, laws: tuple[str, ...], rate_hz: float, options: ExportOptions) -> tuple[Finding, ...]:
    """The findings for the heads, the gravest first; GainsError where one says stop and `anyway` is not given."""
    found = ranked(_found(source, laws, rate_hz, options))
    grave = stops(found)
    if grave and not options.anyway:
        raise GainsError(*(f"{say(one)}; «anyway» exports it all the same, marked" for one in grave))
    return (*((finding("export-anyway", "export"),) if grave else ()), *found)


def _found(source: Source, laws: tuple[str, ...], rate_hz: float, options: ExportOptions) -> Iterator[Finding]:
    low, high = source.limits
    if not low <= options.duty_on_fault <= high:
        yield finding(
            "export-fault-outside", "export", duty=options.duty_on_fault, unit=source.units[0], low=low, high=high
        )
    if {"pi", "rc"} & set(laws):
        yield from _gains(source, laws, rate_hz)
    if {"inverse", "plant"} & set(laws):
        yield from _plant(source, laws)


def _gains(source: Source, laws: tuple[str, ...], rate_hz: float) -> Iterator[Finding]:
    yield from _unstable(source, laws, rate_hz)
    gains = source.gains
    if gains is None:
        return
    if gains.unidentified:
        yield finding("export-unidentified", "gains", why=gains.unidentified)
    yield from stops(gains.findings)
    if source.fit is not None:
        yield from (one for one in stops(source.fit.findings) if one.subject == "linear")
    if "rc" in laws and gains.rc is not None:
        holds = gains.guarantee.holds if gains.guarantee else _holds(gains.rc.guaranteed, gains.rc.phi_holds)
        if holds is None:
            yield finding("export-guarantee-unknown", "rc")
        elif holds:
            yield finding("export-guarantee-holds", "rc")
        else:
            missing = gains.guarantee.missing if gains.guarantee else _missing(gains.rc.guaranteed, gains.rc.phi_holds)
            yield finding("export-guarantee-missing", "rc", missing=", ".join(missing))
    if abs(rate_hz - source.rate_hz) > 1e-6 * source.rate_hz:
        yield finding("export-other-rate", "gains", rate_hz=rate_hz, made_hz=source.rate_hz)
    worst = source.margins.worst if source.margins else None
    numbers = {
        f"{law}_{key}": getattr(margin, key)
        for law in laws
        if (margin := getattr(worst, law, None)) is not None
        for key in ("gain_db", "phase_deg", "delay_s")
    }
    if numbers:
        yield finding("export-margins", "gains", **numbers)


def _holds(guaranteed: bool | None, phi_holds: bool | None) -> bool | None:
    return None if guaranteed is None else guaranteed and phi_holds is not False


def _missing(guaranteed: bool | None, phi_holds: bool | None) -> tuple[str, ...]:
    return tuple(name for name, holds in (("rho", guaranteed), ("phi", phi_holds)) if holds is False)


def _unstable(source: Source, laws: tuple[str, ...], rate_hz: float) -> Iterator[Finding]:
    """Each loop around held duties of the plant, else on the linear model, at the rate that is baked in."""
    points = _points(source)
    if not points:
        yield finding("export-margins-unknown", "gains")
    timing = Timing(rate_hz, source.pwm_hz)
    for law in laws:
        if law not in ("pi", "rc"):
            continue
        bad = {
            duty for duty, torque, lags in points if not is_stable(_feedback(source, law, torque, duty), lags, timing)
        }
        if source.margins is not None and abs(rate_hz - source.rate_hz) <= 1e-6 * source.rate_hz:
            told = ((one.duty_pct, getattr(one, law)) for one in source.margins.points)
            bad |= {duty for duty, margin in told if margin is not None and margin.stable is False}
        if bad:
            yield finding("export-unstable", law.upper(), sorted(bad), rate_hz=rate_hz, unit=source.units[0])


def _feedback(source: Source, law: str, torque: float, duty: float) -> Feedback:
    if law == "pi" and source.pi is not None:
        return pi_feedback(source.pi)
    assert source.rc is not None
    return rc_feedback(source.rc, torque, duty)


def _points(source: Source) -> Points:
    """Duty, torque and lags around it."""
    if source.plant is None and source.linear is None:
        return []
    linear = Linear(*(source.linear or (1.0, 1.0, 0.0)))  # not looked at where there is a plant
    return operating_points(Fit(), linear, source.plant, Bounds("", (), 1.0, 1.0, ()), source.limits)


def _plant(source: Source, laws: tuple[str, ...]) -> Iterator[Finding]:
    subject = "plant" if "plant" in laws else "inverse"
    fit = source.fit
    if fit is not None and fit.nonlinear is not None:
        yield from (one for one in stops(fit.findings) if one.subject in OF_THE_PLANT)
        if fit.nonlinear.identifiable is False:
            why = "the records do not determine the nonlinear model"
            yield finding("export-unidentified", subject, why=why)
        if fit.nonlinear.solver is not None and not fit.nonlinear.solver.converged:
            yield finding("export-not-converged", subject)
    if source.plant is not None and source.plant.release is None:
        yield finding("export-no-release", subject)
