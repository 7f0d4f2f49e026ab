"""What `eaid tune-rc` prints: one verdict and one table; margins and the readings of ρ on request."""

from eaid.cli import console
from eaid.results.gain_checks import Optimized
from eaid.results.gains import Gains

SHORT = {"rho": "ρ", "phi": "φ", "Q_M": "Q_M", "duty-limit": "duty limit"}
"""Conditions of the guarantee."""
YES = {True: "yes", False: "NO", None: "not known"}


def show(gains: Gains, all_of_it: bool = False) -> None:
    """The verdict and the gains; with `all_of_it` what they were made of, and every margin."""
    console.line(verdict(gains))
    console.table("Gains", ["", "value", "unit; what it is"], [*_robust(gains), *_pi(gains), *_replayed(gains)])
    if gains.optimized is not None:
        _optimized(gains.optimized, gains)
    if all_of_it:
        _readings(gains)
        if gains.margins is not None:
            from eaid.report.tables.gains import margins_table

            timing = gains.margins.timing
            latch = f"duty latched at {timing.pwm_hz:g} Hz" if timing.pwm_hz else "duty not latched"
            console.show(margins_table(gains))
            console.line(f"at {timing.rate_hz:g} Hz, {latch}")


def verdict(gains: Gains) -> str:
    """`guarantee: NO (φ, duty limit)`."""
    judged = gains.guarantee
    if judged is None:
        return "guarantee: not known"
    missing = [SHORT[name] for name in judged.missing]
    open_ones = [SHORT[one.name] for one in judged.conditions if one.holds is None]
    why = ", ".join(missing) or (f"{', '.join(open_ones)} cannot be told" if open_ones else "")
    return f"guarantee: {YES[judged.holds]}{f' ({why})' if why else ''}"


def units(given: str, measured: str) -> tuple[str, str]:
    """Units of input and output as tables name them; one that nobody gave is called by what it is of."""
    return given or "input", measured or "output"


def per(unit: str) -> str:
    """A unit behind a fraction's line."""
    return f"({unit})" if "·" in unit or "/" in unit else unit


def _robust(gains: Gains) -> list[list[str]]:
    rc, (i, o) = gains.rc, units(gains.input_unit, gains.output_unit)
    if rc is None:
        return []
    motion = f"natural frequency {rc.natural_frequency_rad_s:.4g} rad/s, damping {rc.damping:.3g}"
    reached = f"{rc.rho.convention}; α {_number(rc.alpha)}, really reached {_number(rc.alpha_reached)}"
    rows = [
        ["RC K_P, K_D", f"{rc.K_P:.5g}, {rc.K_D:.5g}", f"1/s², 1/s; {motion}"],
        ["  B̂", f"{rc.B_hat:.5g}", f"{i}·s/{per(o)}; {rc.B_hat_convention}, B {_number(rc.B_m)} … {_number(rc.B_M)}"],
        ["  ρ(ξ)", f"{rc.rho.constant:.5g} + {rc.rho.slope:.4g} ‖ξ‖", f"{o}/s; {reached}"],
        ["  ε, γ", f"{rc.epsilon:.4g}, {rc.gamma:.4g}", f"z = {rc.Q[1][0]:.4g} q̃ + {rc.Q[1][1]:.4g} e"],
    ]
    for one in gains.guarantee.conditions if gains.guarantee is not None else ():
        told = f"{_number(one.needed)} needed, {_number(one.available)} there, {one.unit}"
        rows.append([f"  {SHORT[one.name]} holds", YES[one.holds], told])
    return [*rows, *_least(gains, "rc")]


def _pi(gains: Gains) -> list[list[str]]:
    pi, (i, o) = gains.pi, units(gains.input_unit, gains.output_unit)
    if pi is None:
        return []
    settles = "never settles" if pi.settling_s is None else f"settles in {pi.settling_s:.4g} s"
    how = "designed" if pi.asked is not None else "given"
    reached = f"{how}; {_number(pi.overshoot_pct)} % overshoot, {settles}"
    return [
        ["PI K_P, K_I", f"{pi.K_P:.5g}, {pi.K_I:.5g}", f"{i}/{per(o)}, {i}/({o}·s); {reached}"],
        *_least(gains, "pi"),
    ]


def _least(gains: Gains, name: str) -> list[list[str]]:
    worst = getattr(gains.margins.worst, name) if gains.margins is not None and gains.margins.worst else None
    if worst is None:
        return []
    if worst.stable is False:
        return [["  least margins", "unstable", ""]]
    gain = "> 80" if worst.gain_db is None else f"{worst.gain_db:.3g}"
    phase = "none" if worst.phase_deg is None else f"{worst.phase_deg:.3g}"
    delay = "> 200" if worst.delay_s is None else f"{1e3 * worst.delay_s:.3g}"
    return [["  least margins", f"{gain}, {phase}", f"dB, °; delay {delay} ms"]]


def _replayed(gains: Gains) -> list[list[str]]:
    told, rc = gains.replayed, gains.rc
    bound = rc.ultimate_bound.torque_error_nm if rc is not None and rc.ultimate_bound is not None else None
    rows = [["ultimate bound", "none" if bound is None else f"{bound:.4g}", f"{gains.output_unit}; error in the end"]]
    for name, one in (("RC", told.rc), ("PI", told.pi)) if told is not None else ():
        if told is not None and one is not None:
            what = f"{gains.output_unit}; replayed on the fitted plant, {told.reference}"
            rows.append([f"{name} largest error", _number(one.max_abs_error_nm), what])
    return rows


def _readings(gains: Gains) -> None:
    rc = gains.rc
    if rc is None or rc.rho.readings is None:
        return
    rows = [
        [name, _number(row.phi), f"{_number(row.phi_honest_pct)} {gains.input_unit}",
         f"{_number(row.constant)} + {_number(row.slope)}·‖ξ‖"]
        for name, row in (("paper", rc.rho.readings.paper), ("textbook", rc.rho.readings.textbook)) if row is not None
    ]  # fmt: skip
    console.table("Readings of Eq. (15)", ["reading", "φ", "means", "ρ(ξ)"], rows)
    if rc.equal_pi is not None and rc.equal_pi.K_P is not None:
        console.line(f"inside the layer the RC is a PI of {rc.equal_pi.K_P:.4g}, {_number(rc.equal_pi.K_I)}")


SOURCES = {"given": "given", "logs": "white part of what the logs show", "fit": "as the fit tells it",
           "supposed": "supposed"}  # fmt: skip


def _optimized(told: Optimized, gains: Gains) -> None:
    i, o = units(gains.input_unit, gains.output_unit)
    rows = [
        ("RMS error", "rms_error_nm", o), ("  of the worst plant", "worst_plant_rms_error_nm", o),
        ("largest error", "max_abs_error_nm", o), ("chattering", "mean_abs_duty_step_pct", f"{i} per sample"),
        ("at a limit", "saturated_fraction", "of the time"), ("P's scale", "p_scale", ""), ("ε", "epsilon", ""),
        ("φ", "phi_honest_pct", i), ("B̂", "B_hat", f"{i}·s/{per(o)}"), ("K_P", "K_P", "1/s²"), ("K_D", "K_D", "1/s"),
    ]  # fmt: skip
    console.table(
        f"Optimised on the {told.reference}, {told.plants} plants, noise {told.noise_nm:.3g} {o} "
        f"({SOURCES[told.noise_source]}), chattering up to {told.limit_pct:.3g} {i}",
        ["", "before", "after", "unit"],
        [
            *_walls(told),
            *(
                [name, f"{getattr(told.before, key):.5g}", f"{getattr(told.after, key):.5g}", unit]
                for name, key, unit in rows
            ),
        ],
    )


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:.4g}"


def _walls(told: Optimized) -> list[list[str]]:
    """The stiffest passive wall, where the search was for it."""
    if told.optimized_for != "stiffness" or not told.before_cost or not told.after_cost:
        return []
    return [["stiffest passive wall", f"{1 / told.before_cost:.5g}", f"{1 / told.after_cost:.5g}", "N·m/rad"]]
