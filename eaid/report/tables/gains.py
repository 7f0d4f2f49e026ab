"""Tables of gains: what the guarantee needs and has, Table IV, what follows from it, margins, virtual walls."""

from eaid.report import published
from eaid.report.rig import gain, printed_head
from eaid.report.style import controller_name
from eaid.report.tables.table import Cell, Table, columns, level, number
from eaid.results.coupling import Coupling
from eaid.results.gain_checks import Margin
from eaid.results.gains import Condition, Gains

CONDITIONS = {
    "rho": ("ρ", "the robust term covers the model's error, inequality (15)"),
    "phi": ("φ", "bound on the error of the model's drift term"),
    "Q_M": ("Q_M", "bound on the slope of the torque reference"),
    "duty-limit": ("duty limit", "the actuator can deliver the robust term"),
}
"""Condition of the guarantee → how it is called, and what it says."""


def called(condition: Condition) -> str:
    """How a condition is called; only the paper's input is a duty."""
    if condition.name == "duty-limit" and condition.unit not in ("%", ""):
        return "input limit"
    return CONDITIONS.get(condition.name, (condition.name,))[0]


def conditions_of(gains: Gains) -> tuple[Condition, ...]:
    """The rows of the checklist."""
    return gains.guarantee.conditions if gains.guarantee is not None else ()


def printed(gains: Gains, asked: bool | None = None) -> str:
    """Head of the published controller's column; empty where it does not belong beside this one."""
    return printed_head("clutch", (gains.input_unit, gains.output_unit), asked)


def checklist(gains: Gains) -> Table:
    """What the guarantee needs, and what is there."""
    rows = tuple(
        (called(one), CONDITIONS.get(one.name, ("", one.name))[1], one.needed,
         one.available, one.unit, {True: "holds", False: "does not hold", None: "not known"}[one.holds])
        for one in conditions_of(gains)
    )  # fmt: skip
    caption = "The robust controller is proven stable only where every row holds."
    heads = columns("condition", "what it says", ("needed", "", 3), ("available", "", 3), "unit", "verdict")
    return Table("What the guarantee needs", caption, heads, rows)


def table_iv(gains: Gains, asked: bool | None = None) -> Table:
    """The robust controller's parameters."""
    rc, out = gains.rc, gains.output_unit
    per, beside = gain(gains.input_unit, out), printed(gains, asked)
    meaning = {
        "B_m": (per, "least input gain B that the design allows for"),
        "B_M": (per, "largest input gain B that the design allows for"),
        "Q_M": (f"{out}/s", "steepest reference"),
        "phi": ("as entered in Eq. (15)", "bound on the error of the model's drift term"),
        "epsilon": ("1", "half width of the layer where the robust term is linear"),
        "gamma": ("1", "sharpness of the switch at that layer's edge"),
        "K_D": ("1/s", "gain on the error"),
        "K_P": ("1/s²", "gain on the integral of the error"),
    }
    names = {"phi": "φ", "epsilon": "ε", "gamma": "γ"}
    rows: list[tuple[Cell, ...]] = []
    for key, (unit, said) in meaning.items():
        ours = getattr(rc, key) if rc is not None else None
        rows.append((names.get(key, key), *([published.TABLE_IV[key]] if beside else []), ours, unit, said))
    heads = columns("symbol", *([(beside, "", 3)] if beside else []), "ours", "unit", "what it does")
    return Table("Table IV" if beside else "Robust controller", "The robust controller's choices.", heads, tuple(rows))


def gains_table(gains: Gains, asked: bool | None = None) -> Table:
    """What follows from Table IV's parameters: B̂, α, ρ, Q; and the PI."""
    rc, pi, beside = gains.rc, gains.pi, printed(gains, asked)
    unit, out = gains.input_unit or "input", gains.output_unit
    rows: list[tuple[str, str, Cell, str, str]] = []
    if rc is not None:
        per = gain(unit, out)
        rows += [
            ("B̂", "12.5", rc.B_hat, per, "input gain that the controller assumes"),
            ("α by Eq. (16)", "0.5491", rc.alpha, "1", "(B_M − B_m)/(B_M + B_m)"),
            ("α reached", "–", rc.alpha_reached, "1", "largest |1 − b B̂| over the range of B"),
            ("ρ, constant", "10.81", rc.rho.constant, f"{out}/s", "size of the robust term without error"),
            ("ρ, slope", "6.586", rc.rho.slope, "per ‖ξ‖", "how the robust term grows with the error"),
            ("Q12, Q22", "–", f"{number(rc.Q[0][1])}, {number(rc.Q[1][1])}", "1", "weights of the switching variable"),
        ]
        if (bound := rc.ultimate_bound) is not None:
            rows.append(("error in the end", "–", bound.torque_error_nm, out, "bound that ε and ρ promise"))
    if pi is not None:
        said = "as reached on the linear model"
        rows += [
            ("PI: K_P", "21", pi.K_P, f"{unit}/({out})", "gain on the error"),
            ("PI: K_I", "360", pi.K_I, f"{unit}/({out}·s)", "gain on the integral of the error"),
            ("PI: overshoot", "1", pi.overshoot_pct, "%", said),
            ("PI: settling time", "0.27", pi.settling_s, "s", f"to within 2 %, {said}"),
        ]
    shown = tuple(row if beside else (row[0], *row[2:]) for row in rows)
    heads = columns("symbol", *([beside] if beside else []), "ours", "unit", "what it is")
    return Table("Gains that follow", "What the choices above and the linear model give.", heads, shown)


def margins_table(gains: Gains) -> Table:
    """Gain, phase and delay margins of both controllers around held inputs."""
    rows = tuple(
        (level(point.duty_pct), point.torque_nm, *_margin(point.rc), *_margin(point.pi))
        for point in (gains.margins.points if gains.margins else ())
    )
    caption = "How much the loop's gain may grow, its phase may lag, and its delay may grow before it becomes "
    heads = columns(
        ("held input", gains.input_unit), ("output", gains.output_unit, 3), ("RC: gain", "dB", 3), ("phase", "°", 3),
        ("delay", "ms", 3), ("PI: gain", "dB", 3), ("phase", "°", 3), ("delay", "ms", 3),
    )  # fmt: skip
    return Table("Margins", f"{caption}unstable, around a held input.", heads, rows)


def _margin(one: Margin | None) -> tuple[Cell, Cell, Cell]:
    if one is None:
        return None, None, None
    return one.gain_db, one.phase_deg, None if one.delay_s is None else 1e3 * one.delay_s


def walls_table(coupling: Coupling) -> Table:
    """How stiff a wall each loop may render at each torque."""
    options = coupling.options
    heads = columns(
        "loop", ("torque", coupling.output_unit, 3), ("passive", "N·m/rad", 3), ("stable", "N·m/rad", 3),
        ("lost at", "Hz", 3), ("replayed", "N·m/rad", 3),
    )  # fmt: skip
    rows = tuple(
        (controller_name(one.loop), one.torque_nm, one.K_passive, one.K_stable, one.lost_hz, one.K_replayed)
        for one in coupling.walls
    )
    caption = (
        f"Passive: on any passive limb of {options.limb_damping:g} N·m·s/rad. Stable: on this limb, "
        f"{options.limb_inertia:g} kg·m², linear and sampled. Replayed: the nonlinear plant. A dash: no limit."
    )
    return Table("How stiff a virtual wall may be", caption, heads, rows)
