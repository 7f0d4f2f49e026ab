"""Tables of gains: what the guarantee needs and has, Table IV, what follows from it, margins, virtual walls."""

from collections.abc import Mapping
from operator import itemgetter

from eaid.apparatus import PAPER
from eaid.control.kinds import LAW_KINDS
from eaid.findings import enumerated
from eaid.options import LAWS
from eaid.report import rig
from eaid.report.rig import controller_name, gain_unit
from eaid.report.tables import Cell, Table, level, table_of
from eaid.results.coupling import Coupling
from eaid.results.gains import PI, Compared, Condition, Gains, Margin, Margins, Robust
from eaid.shown import number, output_word

# Condition of the guarantee → how it is called, what it says, and why it does not hold
CONDITION_ROWS = {
    "rho": ("ρ", "the robust term covers the model's error, inequality (15)",
            "the robust term ρ covers {a} of the {n} {unit} that the model's error needs"),
    "phi": ("φ", "bound on the error of the model's drift term",
            "φ allows the model's drift term {a} of the {n} {unit} needed"),
    "range": ("range", "φ was seen over all outputs that may occur",
              "the output goes to {n} {unit}, φ was seen up to {a}"),
    "Q_M": ("Q_M", "bound on the slope of the reference",
            "the gains assume a slope of {a}, the reference has {n} {unit}"),
    "duty-limit": ("duty limit", "the actuator has the most that a plant may take along the reference",
                   "the actuator ends at {a}, a plant within the fit's bounds may take {n} {unit}"),
    "duty-floor": ("duty floor", "the actuator has the least that a plant may take along the reference",
                   "the actuator begins at {a}, a plant within the fit's bounds may take {n} {unit}"),
    "sampling": ("sampling", "the extreme plants keep 6 dB and 45° under the loop as it is sampled and latched",
                 "as it is sampled and latched, the extreme plants keep {a} of the {n} {unit} needed"),
    "sampled-error": ("sampled error", "the extreme plants end within the bound as the loop is sampled, too",
                      "as it is sampled and latched, the extreme plants end {n} {unit} off, the bound is {a}"),
    "falls": ("falls", "B of falls lies within B_m and B_M, as the proof supposes",
              "B of falls goes to {n}, where the gains assume it within {a}"),
    "dead-time": ("dead time", "the plant answers at once, as the proof supposes",
                  "the proof knows no dead time, the plant has {a} {unit}"),
}  # fmt: skip
# Condition that no gains meet → what they would have to mend
BEYOND_GAINS = {
    "duty-limit": "the actuator's range",
    "duty-floor": "the actuator's range",
    "dead-time": "a dead time",
    "falls": "falls unlike rises",
}


def called(condition: Condition) -> str:
    """How a condition is called; only the paper's input is a duty."""
    name = CONDITION_ROWS.get(condition.name, (condition.name,))[0]
    return name if condition.unit in ("%", "") else name.replace("duty", "input")


def conditions_of(gains: Gains) -> tuple[Condition, ...]:
    """The rows of the checklist."""
    return gains.guarantee.conditions if gains.guarantee is not None else ()


def guarantee_story(gains: Gains) -> list[str]:
    """The one verdict on the guarantee: which conditions fail and by how much; what these gains have instead."""
    rows = {row.name: row for row in conditions_of(gains) if row.holds is False}
    unknown = [called(row) for row in conditions_of(gains) if row.holds is None]
    if not rows and unknown:
        return [f"guarantee not known ({', '.join(unknown)})"]
    if not rows and conditions_of(gains):
        return ["guarantee yes"]
    if not rows:
        return ["no robust controller, so no guarantee" if gains.rc is None else "guarantee not judged in this file"]
    high, low = rows.get("duty-limit"), rows.get("duty-floor")
    both = None not in (high, low) and None not in (high.needed, low.needed)  # type: ignore[union-attr]
    why = []
    for name, row in rows.items():
        n, a = next(  # of digits as many as tell them apart
            (n, a) for digits in (3, 5, 9) if (n := number(row.needed, digits)) != (a := number(row.available, digits))
            or digits == 9
        )  # fmt: skip
        if both and name == "duty-floor":
            continue
        if both and name == "duty-limit":
            n, a = f"{number(low.needed, 3)} … {n}", f"{number(low.available, 3)} … {a}"  # type: ignore[union-attr]
            why.append(f"the actuator has {a}, a plant within the fit's bounds may take {n} {row.unit}")
        elif name in CONDITION_ROWS and None not in (row.needed, row.available):
            why.append(CONDITION_ROWS[name][2].format(n=n, a=a, unit=row.unit))
        else:
            why.append(f"no {called(row)} is enough")
    said = f"guarantee NO: {'; '.join(why)}"
    worst = gains.margins.worst.get("rc") if gains.margins is not None else None
    beyond = dict.fromkeys(BEYOND_GAINS[name] for name in rows if name in BEYOND_GAINS)
    if worst is None or worst.phase_deg is None or not beyond:
        return [said]
    gain_margin = "" if worst.gain_db is None else f"gain margin {worst.gain_db:.3g} dB, "
    have = f"{gain_margin}phase margin {worst.phase_deg:.3g}°"
    return [said, f"No gains mend {' or '.join(beyond)}; what you have: {have}"]


# Row of the comparison → how it is called
COMPARED_ROWS = {
    "rc": "RC", "equal_pi_feedforward": "PI of RC's margins and feedforward", "equal_pi": "PI of RC's margins",
    "pi": "PI, designed", "paper_pi": "the paper's PI",
}  # fmt: skip


ALIKE_DB, ALIKE_DEG = 1.5, 5.0  # By which margins that are told to be equal may differ
# Which PI RC is held against
AGAINST = {
    "equal_pi": "At equal margins a PI", "pi": "At margins no smaller the designed PI",
    "paper_pi": "At margins no smaller the paper's PI",
}  # fmt: skip


def comparison(gains: Gains) -> str:
    """What RC is worth beside the best PI of its margins or larger ones, and beside the one of its own with its
    feedforward; empty where nothing was replayed."""
    rows = gains.replayed.rows if gains.replayed is not None else {}
    errors = {name: one.max_abs_error_nm for name, one in rows.items() if one.max_abs_error_nm}
    own, alike, fed = (errors.get(name) for name in ("rc", "equal_pi", "equal_pi_feedforward"))
    if not own or not alike or not fed:
        return ""
    least = {name: errors[name] for name in AGAINST if name in errors and _as_safe(rows[name], rows["rc"])}
    best = min({"equal_pi": alike, **least}.items(), key=itemgetter(1))
    by_term = 100 * (1 - own / fed)
    against = AGAINST[best[0]]
    if best[0] == "equal_pi" and not _as_wide(rows["equal_pi"], rows["rc"]):
        against = "A PI of RC's slopes, whose margins are not RC's,"
    size = f"{abs(by_term):.0f} %" if abs(by_term) >= 0.5 else "nothing"
    worth = f"costs {size}" if by_term <= -0.5 else f"is worth {size}"
    return (
        f"{against} leaves {best[1] / own:.1f} times RC's largest error, a PI of RC's margins with its "
        f"feedforward {fed / own:.2f} times: the robust term itself {worth}."
    )


def _as_wide(one: Compared, other: Compared) -> bool:
    """Whether the margins of two loops are alike, to `ALIKE_DB` and `ALIKE_DEG`."""
    pairs = ((one.gain_db, other.gain_db, ALIKE_DB), (one.phase_deg, other.phase_deg, ALIKE_DEG))
    return all(a is b is None or (a is not None and b is not None and abs(a - b) <= most) for a, b, most in pairs)


def _as_safe(one: Compared, other: Compared) -> bool:
    """Whether one loop has both margins of another, or more; None: no limit."""
    pairs = ((one.gain_db, other.gain_db), (one.phase_deg, other.phase_deg))
    return one.stable is not False and all(a is None or (b is not None and a >= b) for a, b in pairs)


def controllers_table(gains: Gains) -> Table:
    """Controllers, their gains, least margins and largest errors: all that were compared, else those of the file."""
    errors, margins = gains.replayed, gains.margins or Margins()
    on = f" on the {errors.reference}" if errors is not None else ""
    if errors is not None and errors.reference != "multisine" and errors.counted_from_s:
        on += f", from {errors.counted_from_s:.3g} s on"
    names = [*(errors.rows if errors is not None else gains.controllers_by_name)]
    code = [law for name in names if (law := "pi-feedforward" if name == "equal_pi_feedforward" else name) in LAWS]
    alone = f"eaid export knows {enumerated(code)}; the other rows run in replays alone."
    said = ("Margins: the least over the held inputs.", comparison(gains), alone if 0 < len(code) < len(names) else "")
    rows: list[tuple[str, str, tuple[Cell, Cell], Cell]] = []
    for name, one in (errors.rows if errors is not None else {}).items():
        held = gains.controllers_by_name.get(name)
        slopes = f"K_P {number(one.K_P, 3)}, K_I {number(one.K_I, 3)}"
        title = COMPARED_ROWS.get(name, controller_name(name))
        rows.append((title, slopes if held is None else _gains(name, held), _margin_cells(one), one.max_abs_error_nm))
    if not rows:
        rows = [(controller_name(name), _gains(name, held), _margin_cells(margins.worst.get(name)), None)
                for name, held in gains.controllers_by_name.items()]  # fmt: skip
    return table_of(
        "Controllers", " ".join(filter(None, said)), rows,
        ("controller", itemgetter(0)), ("gains", itemgetter(1)),
        (("gain margin", "dB", 3), lambda of: of[2][0]), (("phase margin", "°", 3), lambda of: of[2][1]),
        ((f"largest error{on}", gains.output_unit, 3), itemgetter(3)),
    )  # fmt: skip


def _gains(name: str, held: Robust | PI | Mapping[str, float]) -> str:
    shown = LAW_KINDS[name].shown if name in LAW_KINDS else {}
    values = {key: held.get(key) if isinstance(held, Mapping) else getattr(held, key) for key in shown}
    return ", ".join(f"{shown[key]} {number(value, 3)}" for key, value in values.items())


def tables_of(gains: Gains) -> list[Table]:
    """Controllers with their least margins and largest errors, what the guarantee needs, the gains, all margins."""
    margins, controllers = gains.margins or Margins(), controllers_table(gains)
    checklist = table_of(
        "What the guarantee needs", "The robust controller is proven stable only where every row holds.",
        conditions_of(gains),
        ("condition", called), ("what it says", lambda one: CONDITION_ROWS.get(one.name, ("", one.name))[1]),
        (("needed", "", 3), "needed"), (("available", "", 3), "available"), ("unit", "unit"),
        ("verdict", lambda one: {True: "holds", False: "does not hold", None: "not known"}[one.holds]),
    )  # fmt: skip
    rows = [(level(one.duty_pct) + ", falling" * one.falling, one.torque_nm, one.loops) for one in margins.points]
    least = [("least", None, margins.worst)] if margins.worst else []
    loops = [
        ((f"{controller_name(name)}: gain" if k == 0 else "phase", unit, 3),
         lambda of, name=name, k=k: _margin_cells(of[2].get(name))[k])
        for name in margins.worst for k, unit in enumerate(("dB", "°"))
    ]  # fmt: skip
    timing = margins.timing
    latch = f"the input latched at {timing.pwm_hz:g} Hz" if timing.pwm_hz else "the input not latched"
    every = table_of(
        "Margins",
        "How much the loop's gain may grow and its phase may lag before it becomes unstable, around a held input; "
        f"sampled at {timing.rate_hz:g} Hz, {latch}. A dash: no limit up to 80 dB.",
        [*rows, *least],
        (("held input", gains.input_unit), lambda of: of[0]), (("output", gains.output_unit, 3), lambda of: of[1]),
        *loops,
    )  # fmt: skip
    return [controllers, checklist, table_iv(gains), every]


def table_iv(gains: Gains) -> Table:
    """What was chosen for the robust controller, what follows from it and the linear model, and the PI."""
    rc, pi = gains.rc, gains.pi
    on_papers_rig = (gains.input_unit, gains.output_unit) == PAPER["clutch"]
    unit, out = gains.input_unit, gains.output_unit
    per = gain_unit(unit, out)
    rows: list[tuple[str, str | None, Cell, str, str]] = []
    if rc is not None:
        chosen = (
            ("B_m", "B_m", per, "least input gain B that the design allows for"),
            ("B_M", "B_M", per, "largest input gain B that the design allows for"),
            ("Q_M", "Q_M", f"{out}/s", "steepest reference"),
            ("phi", "φ", "as entered in Eq. (15)", "bound on the error of the model's drift term"),
            ("epsilon", "ε", "1", "half width of the layer where the robust term is linear"),
            ("gamma", "γ", "1", "sharpness of the switch at that layer's edge"),
            ("K_D", "K_D", "1/s", "gain on the error"),
            ("K_P", "K_P", "1/s²", "gain on the integral of the error"),
        )
        rows += [(name, number(rig.TABLE_IV[key], 3), getattr(rc, key), u, said) for key, name, u, said in chosen]
        rows += [
            ("B̂", "12.5", rc.B_hat, per, "input gain that the controller assumes"),
            ("α by Eq. (16)", "0.5491", rc.alpha, "1", "(B_M − B_m)/(B_M + B_m)"),
            ("α reached", None, rc.alpha_reached, "1", "largest |1 − b B̂| over the range of B"),
            ("ρ, constant", "10.81", rc.rho.constant, f"{out}/s", "size of the robust term without error"),
            ("ρ, slope", "6.586", rc.rho.slope, "per ‖ξ‖", "how the robust term grows with the error"),
            ("Q12, Q22", None, f"{number(rc.Q[0][1])}, {number(rc.Q[1][1])}", "1", "weights of the switching variable"),
        ]
        said = "guaranteed worst error (only if the guarantee holds)"
        rows.append(("error in the end", None, rc.ultimate_bound_nm, out, said))
    if pi is not None:
        said = "as reached on the linear model, behind its dead time if it has one"
        rows += [
            ("PI: K_P", "21", pi.K_P, f"{unit}/({out})", "gain on the error"),
            ("PI: K_I", "360", pi.K_I, f"{unit}/({out}·s)", "gain on the integral of the error"),
            ("PI: overshoot", "1", pi.overshoot_pct, "%", said),
            ("PI: settling time", "0.27", pi.settling_s, "s", f"to within 2 %, {said}"),
        ]
    caption = "What was chosen, and what follows from it and the linear model."
    return table_of(
        "Table IV" if on_papers_rig else "Gains", caption, rows,
        ("symbol", itemgetter(0)), ("published", itemgetter(1)) if on_papers_rig else None, ("ours", itemgetter(2)),
        ("unit", itemgetter(3)), ("what it is", itemgetter(4)),
    )  # fmt: skip


def _margin_cells(one: Margin | Compared | None) -> tuple[Cell, Cell]:
    if one is None:
        return None, None
    return ("unstable", "–") if one.stable is False else (one.gain_db, one.phase_deg)


def walls_table(coupling: Coupling) -> Table:
    """How stiff a wall each loop may render at each torque."""
    options, (stiffness, damping, inertia) = coupling.options, coupling.units
    caption = (
        f"Passive: on any passive limb of {options.limb_damping:g} {damping}. Stable: on this limb, "
        f"{options.limb_inertia:g} {inertia}, linear and sampled. Replayed: the nonlinear plant. A dash: no limit."
    )
    return table_of(
        "How stiff a virtual wall may be", caption, coupling.walls,
        ("loop", lambda one: controller_name(one.loop)),
        ((output_word(coupling.output_unit), coupling.output_unit, 3), "torque_nm"),
        (("passive", stiffness, 3), "K_passive"),
        (("stable", stiffness, 3), "K_stable"), (("replayed", stiffness, 3), "K_replayed"),
    )  # fmt: skip
