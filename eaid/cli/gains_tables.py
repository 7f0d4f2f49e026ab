"""What `eaid tune-rc` prints: one verdict and one table; margins and the readings of ρ on request."""

from eaid.cli import console
from eaid.results.gains import Gains, Margin, MarginPoint, Optimized

CONDITIONS = {
    "rho": "ρ covers Eq. (15)", "phi": "φ covers |η − η̂|", "Q_M": "Q_M covers the slope",
    "duty-limit": "the actuator delivers B̂ρ",
}  # fmt: skip
SHORT = {"rho": "ρ", "phi": "φ", "Q_M": "Q_M", "duty-limit": "duty limit"}
YES = {True: "yes", False: "NO", None: "not known"}


def show(gains: Gains, all_of_it: bool = False) -> None:
    """The verdict and the gains; with `all_of_it` what they were made of, and every margin."""
    console.line(verdict(gains))
    console.table("Gains", ["", "value", "unit", "what it is"], [*_robust(gains), *_pi(gains), *_replayed(gains)])
    if gains.optimized is not None:
        _optimized(gains.optimized, gains)
    if all_of_it:
        _readings(gains)
        _margins(gains)


def verdict(gains: Gains) -> str:
    """`guarantee: NO (φ, duty limit)`."""
    judged = gains.guarantee
    if judged is None:
        return "guarantee: not known"
    missing = [SHORT[name] for name in judged.missing]
    open_ones = [SHORT[one.name] for one in judged.conditions if one.holds is None]
    why = ", ".join(missing) or (f"{', '.join(open_ones)} cannot be told" if open_ones else "")
    return f"guarantee: {YES[judged.holds]}{f' ({why})' if why else ''}"


def _robust(gains: Gains) -> list[list[str]]:
    rc, (i, o) = gains.rc, (gains.input_unit, gains.output_unit)
    if rc is None:
        return []
    rows = [
        ["RC K_P, K_D", f"{rc.K_P:.5g}, {rc.K_D:.5g}", "1/s², 1/s",
         f"natural frequency {rc.natural_frequency_rad_s:.4g} rad/s, damping {rc.damping:.3g}"],
        ["   B̂", f"{rc.B_hat:.5g}", f"{i}·s/({o})", f"{rc.B_hat_convention}; B {_number(rc.B_m)} … {_number(rc.B_M)}"],
        ["   ρ(ξ)", f"{rc.rho.constant:.6g} + {rc.rho.slope:.6g}·‖ξ‖", f"{o}/s",
         f"{rc.rho.convention}; α {_number(rc.alpha)}, really reached {_number(rc.alpha_reached)}"],
        ["   ε, γ", f"{rc.epsilon:.4g}, {rc.gamma:.4g}", "", f"z = {rc.Q[1][0]:.4g} q̃ + {rc.Q[1][1]:.4g} e"],
    ]  # fmt: skip
    for one in gains.guarantee.conditions if gains.guarantee is not None else ():
        told = f"{_number(one.needed)} needed, {_number(one.available)} there"
        rows.append([f"   {CONDITIONS[one.name]}", YES[one.holds], one.unit, told])
    return [*rows, *_least(gains, "rc")]


def _pi(gains: Gains) -> list[list[str]]:
    pi, (i, o) = gains.pi, (gains.input_unit, gains.output_unit)
    if pi is None:
        return []
    settles = "never settles" if pi.settling_s is None else f"settles in {pi.settling_s:.4g} s"
    reached = f"{_number(pi.overshoot_pct)} % overshoot, {settles}"
    how = "designed" if pi.asked is not None else "given"
    return [
        ["PI K_P, K_I", f"{pi.K_P:.5g}, {pi.K_I:.5g}", f"{i}/({o}), {i}/({o}·s)", f"{how}; {reached}"],
        *_least(gains, "pi"),
    ]


def _least(gains: Gains, name: str) -> list[list[str]]:
    worst = getattr(gains.margins.worst, name) if gains.margins is not None and gains.margins.worst else None
    if worst is None:
        return []
    gain, phase, delay = _margin(worst)
    return [["   least margins", f"{gain}, {phase}", "dB, °", f"delay {delay} ms"]]


def _replayed(gains: Gains) -> list[list[str]]:
    told, rc = gains.replayed, gains.rc
    bound = rc.ultimate_bound.torque_error_nm if rc is not None and rc.ultimate_bound is not None else None
    rows = [["ultimate bound", "none" if bound is None else f"{bound:.4g}", gains.output_unit, "error in the end"]]
    if told is None or told.rc is None or told.pi is None:
        return rows
    errors = f"{_number(told.rc.max_abs_error_nm)} RC, {_number(told.pi.max_abs_error_nm)} PI"
    return [*rows, ["largest error", errors, gains.output_unit, f"replayed on the fitted plant, {told.reference}"]]


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


def _margins(gains: Gains) -> None:
    found = gains.margins
    if found is None:
        return
    timing = found.timing
    latch = f"duty latched at {timing.pwm_hz:g} Hz" if timing.pwm_hz else "duty not latched"
    console.table(
        f"Margins around held inputs, {timing.rate_hz:g} Hz, {latch}",
        [gains.input_unit, gains.output_unit, "RC dB", "°", "ms", "PI dB", "°", "ms"],
        [_point(row) for row in found.points],
    )


def _point(row: MarginPoint) -> list[str]:
    none = ["-", "-", "-"]
    loops = [_margin(one) if one is not None else none for one in (row.rc, row.pi)]
    return [f"{row.duty_pct:.4g}", _number(row.torque_nm), *loops[0], *loops[1]]


def _margin(found: Margin) -> list[str]:
    if found.stable is False:
        return ["unstable", "-", "-"]
    return [
        f"{found.gain_db:.3g}" if found.gain_db is not None else "> 80",
        f"{found.phase_deg:.3g}" if found.phase_deg is not None else "gain below 1",
        f"{1e3 * found.delay_s:.3g}" if found.delay_s is not None else "> 200",
    ]


SOURCES = {"given": "given", "logs": "white part of what the logs show", "fit": "as the fit tells it",
           "supposed": "supposed"}  # fmt: skip


def _optimized(told: Optimized, gains: Gains) -> None:
    i, o = gains.input_unit, gains.output_unit
    rows = [
        ("RMS error", "rms_error_nm", o), ("  of the worst plant", "worst_plant_rms_error_nm", o),
        ("largest error", "max_abs_error_nm", o), ("chattering", "mean_abs_duty_step_pct", f"{i} per sample"),
        ("at a limit", "saturated_fraction", "of the time"), ("P's scale", "p_scale", ""), ("ε", "epsilon", ""),
        ("φ", "phi_honest_pct", i), ("B̂", "B_hat", f"{i}·s/({o})"), ("K_P", "K_P", "1/s²"), ("K_D", "K_D", "1/s"),
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
