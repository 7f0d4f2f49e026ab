"""Tables of gains: what the guarantee needs and has, Table IV, what follows from it, margins, virtual walls."""

from eaid.report import rig
from eaid.report.rig import controller_name, gain
from eaid.report.tables import Cell, Table, columns, level, number, table_of
from eaid.results.coupling import Coupling
from eaid.results.gains import Condition, Gains, Margin, Margins

# Condition of the guarantee → how it is called, what it says, and why it does not hold
CONDITIONS = {
    "rho": ("ρ", "the robust term covers the model's error, inequality (15)",
            "ρ covers {a} of the {n} {unit} that the model's error needs"),
    "phi": ("φ", "bound on the error of the model's drift term", "φ allows {a} of the {n} {unit} needed"),
    "Q_M": ("Q_M", "bound on the slope of the reference",
            "the gains assume a slope of {a}, the reference has {n} {unit}"),
    "duty-limit": ("duty limit", "the actuator can deliver the robust term",
                   "the robust term asks for {n} {unit}, the actuator has {a}"),
    "dead-time": ("dead time", "the plant answers at once, as the proof supposes", "the plant answers {a} {unit} late"),
}  # fmt: skip
BEYOND_GAINS = {"duty-limit", "dead-time"}  # Conditions that no gains meet


def called(condition: Condition) -> str:
    """How a condition is called; only the paper's input is a duty."""
    if condition.name == "duty-limit" and condition.unit not in ("%", ""):
        return "input limit"
    return CONDITIONS.get(condition.name, (condition.name,))[0]


def conditions_of(gains: Gains) -> tuple[Condition, ...]:
    """The rows of the checklist."""
    return gains.guarantee.conditions if gains.guarantee is not None else ()


def guarantee_words(gains: Gains) -> str:
    """The one verdict on the guarantee: yes, NO with what is missing, or what is not known."""
    rows = conditions_of(gains)
    missing = [called(row) for row in rows if row.holds is False]
    unknown = [called(row) for row in rows if row.holds is None]
    if missing:
        return f"NO ({', '.join(missing)})"
    if unknown or not rows:
        return f"not known ({', '.join(unknown)})" if unknown else "not judged in this file"
    return "yes"


def guarantee_story(gains: Gains) -> str:
    """The verdict with its reasons in words and, where no gains can have the guarantee, what these have."""
    rows = [row for row in conditions_of(gains) if row.holds is False]
    if not rows:
        return f"guarantee {guarantee_words(gains)}"
    why = [
        CONDITIONS[row.name][2].format(
            n=number(row.needed, 3), a=number(row.available, 3), unit=row.unit or "of the input"
        )
        if row.name in CONDITIONS and None not in (row.needed, row.available)
        else f"no {called(row)} is enough"
        for row in rows
    ]
    said = f"guarantee NO: {'; '.join(why)}"
    worst = gains.margins.worst.rc if gains.margins is not None and gains.margins.worst is not None else None
    if worst is None or worst.phase_deg is None or not any(row.name in BEYOND_GAINS for row in rows):
        return said
    gain_margin = "" if worst.gain_db is None else f"gain margin {worst.gain_db:.3g} dB, "
    return f"{said}. No gains mend that; what you have: {gain_margin}phase {worst.phase_deg:.3g}°"


def tables_of(gains: Gains) -> list[Table]:
    """The controllers, what the guarantee needs, the gains, all margins; tables that have rows."""
    every = (controllers_table(gains), checklist(gains), table_iv(gains), gains_table(gains), margins_table(gains))
    return [table for table in every if table.rows]


def controllers_table(gains: Gains) -> Table:
    """Each controller with its gains, its least margins and its largest error, one line each."""
    worst, errors = gains.margins.worst if gains.margins else None, gains.replayed
    rows = tuple(
        (
            controller_name(name),
            ", ".join(f"{symbol} {number(getattr(law, key), 3)}" for key, symbol in law.SHOWN.items()),
            *_margin(getattr(worst, name, None)),
            getattr(getattr(errors, name, None), "max_abs_error_nm", None),
        )
        for name, law in gains.laws.items()
    )  # fmt: skip
    on = f" on the {errors.reference}" if errors is not None else ""
    heads = columns(
        "controller", "gains", ("gain margin", "dB", 3), ("phase margin", "°", 3),
        (f"largest error{on}", gains.output_unit, 3),
    )  # fmt: skip
    return Table("Controllers", "Margins: the least over the held inputs.", heads, rows)


def checklist(gains: Gains) -> Table:
    """What the guarantee needs, and what is there."""
    return table_of(
        "What the guarantee needs", "The robust controller is proven stable only where every row holds.",
        conditions_of(gains),
        ("condition", called), ("what it says", lambda one: CONDITIONS.get(one.name, ("", one.name))[1]),
        (("needed", "", 3), "needed"), (("available", "", 3), "available"), ("unit", "unit"),
        ("verdict", lambda one: {True: "holds", False: "does not hold", None: "not known"}[one.holds]),
    )  # fmt: skip


def table_iv(gains: Gains) -> Table:
    """The robust controller's parameters."""
    rc, out = gains.rc, gains.output_unit
    per = gain(gains.input_unit, out)
    beside = (gains.input_unit, gains.output_unit) == rig.PAPER["clutch"]
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
    rows = tuple(
        (names.get(key, key), rig.TABLE_IV[key], getattr(rc, key, None), unit, said)
        for key, (unit, said) in meaning.items()
    )
    heads = columns("symbol", ("published", "", 3), "ours", "unit", "what it does")
    table = Table("Table IV" if beside else "Robust controller", "The robust controller's choices.", heads, rows)
    return table if beside else table.without(1)


def gains_table(gains: Gains) -> Table:
    """What follows from Table IV's parameters: B̂, α, ρ, Q; and the PI."""
    rc, pi = gains.rc, gains.pi
    beside = (gains.input_unit, gains.output_unit) == rig.PAPER["clutch"]
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
    if pi is not None:
        said = "as reached on the linear model"
        rows += [
            ("PI: K_P", "21", pi.K_P, f"{unit}/({out})", "gain on the error"),
            ("PI: K_I", "360", pi.K_I, f"{unit}/({out}·s)", "gain on the integral of the error"),
            ("PI: overshoot", "1", pi.overshoot_pct, "%", said),
            ("PI: settling time", "0.27", pi.settling_s, "s", f"to within 2 %, {said}"),
        ]
        if gains.replayed is not None and (papers := gains.replayed.paper_pi) is not None:
            said = f"of 21 and 360, replayed: {gains.replayed.reference}"
            rows.append(("paper's PI: largest error", "–", papers.max_abs_error_nm, out, said))
    heads = columns("symbol", "published", "ours", "unit", "what it is")
    table = Table("Gains that follow", "What the choices above and the linear model give.", heads, tuple(rows))
    return table if beside else table.without(1)


def margins_table(gains: Gains) -> Table:
    """Gain and phase margins of both controllers around held inputs, the least of each last."""
    margins = gains.margins or Margins()
    rows: list[tuple[Cell, ...]] = [
        (level(point.duty_pct), point.torque_nm, *_margin(point.rc), *_margin(point.pi)) for point in margins.points
    ]
    if margins.worst is not None:
        rows.append(("least", None, *_margin(margins.worst.rc), *_margin(margins.worst.pi)))
    timing = margins.timing
    latch = f"the input latched at {timing.pwm_hz:g} Hz" if timing.pwm_hz else "the input not latched"
    caption = "How much the loop's gain may grow and its phase may lag before it becomes "
    caption += f"unstable, around a held input; sampled at {timing.rate_hz:g} Hz, {latch}. "
    heads = columns(
        ("held input", gains.input_unit), ("output", gains.output_unit, 3), ("RC: gain", "dB", 3), ("phase", "°", 3),
        ("PI: gain", "dB", 3), ("phase", "°", 3),
    )  # fmt: skip
    return Table("Margins", f"{caption}A dash: no limit up to 80 dB.", heads, tuple(rows))


def _margin(one: Margin | None) -> tuple[Cell, Cell]:
    if one is None:
        return None, None
    return ("unstable", "–") if one.stable is False else (one.gain_db, one.phase_deg)


def walls_table(coupling: Coupling) -> Table:
    """How stiff a wall each loop may render at each torque."""
    options = coupling.options
    caption = (
        f"Passive: on any passive limb of {options.limb_damping:g} N·m·s/rad. Stable: on this limb, "
        f"{options.limb_inertia:g} kg·m², linear and sampled. Replayed: the nonlinear plant. A dash: no limit."
    )
    return table_of(
        "How stiff a virtual wall may be", caption, coupling.walls,
        ("loop", lambda one: controller_name(one.loop)), (("torque", coupling.output_unit, 3), "torque_nm"),
        (("passive", "N·m/rad", 3), "K_passive"),
        (("stable", "N·m/rad", 3), "K_stable"), (("replayed", "N·m/rad", 3), "K_replayed"),
    )  # fmt: skip
