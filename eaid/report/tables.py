"""Tables of the page: Tables I–IV with the published value beside ours, and the rest as rows of text."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from eaid.report import published
from eaid.report.rig import apparatus_of

SYMBOLS = {"Ts": "T_s", "C_f": "C_f", "tau1": "τ1", "tau2": "τ2"}
KINDS = {
    "clutch": ("clutch", "%"),
    "friction-force": ("friction over force", "N"),
    "friction-speed": ("friction over speed", "RPM"),
}
"""Kind of experiment → how it is called, and the unit of its levels."""
UNITS = {"Ts": "N·m", "C_f": "1", "tau1": "s", "tau2": "s"}


@dataclass(frozen=True)
class Table:
    """A table of text; the first column names the row."""

    heading: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    formulas: bool = True
    """Whether T_s, u^2 and e^(…) in the cells are formulas; False where cells hold names that users chose."""


def number(value: Any, digits: int = 4) -> str:
    """A number with so many significant digits and a true minus sign; what is no finite number becomes a dash."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, int | float) or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e5:
        decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
        text = f"{value:.{decimals}f}"
    else:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        text = f"{mantissa}e{int(exponent)}"
    return text.replace("-", "−")


def level(value: Any) -> str:
    """A level as people write it: 10, 17.5, 153."""
    return f"{value:.4g}" if isinstance(value, int | float) else "–"


def unit_of_input(fit: Mapping[str, Any]) -> str:
    """Unit of a fit's levels: as the fit says, else that of its kind; empty where levels have none."""
    data = fit.get("data") or {}
    said = data.get("input_unit")
    return said if isinstance(said, str) else KINDS.get(data.get("kind", "clutch"), ("", ""))[1]


def unit_of_output(fit: Mapping[str, Any]) -> str:
    """Unit of what a fit describes: N·m unless it says another."""
    said = (fit.get("data") or {}).get("output_unit")
    return said if isinstance(said, str) and said else "N·m"


def headed(text: str, unit: str) -> str:
    """A column's head with its unit, where it has one."""
    return f"{text} ({unit})" if unit else text


def interval(ends: Any, digits: int = 3) -> str:
    """A 95 % interval as text; a dash where there is none."""
    if not isinstance(ends, Sequence) or len(ends) != 2 or any(not isinstance(end, int | float) for end in ends):
        return "–"
    return f"{number(ends[0], digits)} … {number(ends[1], digits)}"


def formula(trend: Mapping[str, Any], variable: str) -> str:
    """A fitted trend as one line of text, by its form in fit.json."""
    c = [float(value) for value in trend["coefficients"]]

    def signed(value: float) -> str:
        return f"{'−' if value < 0 else '+'} {number(abs(value))}"

    if trend["form"] == "linear":
        return f"{number(c[0])} {variable} {signed(c[1])}"
    if trend["form"] == "merged-exponential":
        return f"({number(c[0])} {signed(c[1])} {variable}) e^({number(c[2])} {variable})"
    return f"{number(c[0])} e^({number(c[1])} {variable}) {signed(c[2])} e^({number(c[3])} {variable})"


def _trends(
    fit: Mapping[str, Any], printed: Mapping[str, tuple[str, Any, float]], variable: str
) -> tuple[tuple[str, ...], ...]:
    trends = (fit.get("friction") or {}).get("trends") or {}
    rows = []
    for name, (text, _coefficients, rmse) in printed.items():
        ours = trends.get(name) or {}
        shown = formula(ours, variable) if ours.get("coefficients") else "not fitted"
        rows.append((SYMBOLS[name], UNITS[name], text, number(rmse, 3), shown, number(ours.get("rmse"), 3)))
    return tuple(rows)


TREND_COLUMNS = ("parameter", "unit", "published", "published RMSE", "ours", "our RMSE")


def table_i(fit: Mapping[str, Any]) -> Table:
    """Friction over the normal stress σ [kPa]."""
    return Table(
        "Table I",
        "The friction curve's values over the normal stress σ in kPa, at constant speed.",
        TREND_COLUMNS,
        _trends(fit, published.TABLE_I, "σ"),
    )


def table_ii(fit: Mapping[str, Any]) -> Table:
    """Friction over the rotation speed Ω [RPM]."""
    return Table(
        "Table II",
        "The friction curve's values over the rotation speed Ω in RPM, at constant force. The published τ2 "
        "is two equal rates "
        "with huge opposite weights: at its printed digits only 100 e^(−0.0507 Ω) is left.",
        TREND_COLUMNS,
        _trends(fit, published.TABLE_II, "Ω"),
    )


def table_iii(fit: Mapping[str, Any]) -> Table:
    """The ten coefficients and C of the nonlinear model."""
    part = fit["nonlinear"]
    ci = part.get("ci95") or {}
    used = "two-stage" if "joint" in part else "joint"
    beside_name = "joint" if used == "two-stage" else "two-stage"
    two = part.get("joint") or part.get("two_stage") or {}
    two_ci = two.get("ci95") or {}
    rows = []
    for letter, name, unit in (("a", "tau1", "s"), ("b", "tau2", "s"), ("c", "Ts", "N·m")):
        intervals, beside, beside_ci = (given.get(name) or [] for given in (ci, two, two_ci))
        for power, ours in enumerate(part[name]):
            printed = published.TABLE_III[name]
            rows.append(
                (
                    f"{letter}_{power}",
                    f"{SYMBOLS[name]}, u^{power}" if power else f"{SYMBOLS[name]}, constant",
                    number(printed[power], 3) if power < len(printed) else "–",
                    number(ours),
                    interval(intervals[power] if power < len(intervals) else None),
                    *(
                        (
                            number(beside[power]) if power < len(beside) else "–",
                            interval(beside_ci[power] if power < len(beside_ci) else None),
                        )
                        if two
                        else ()
                    ),
                    f"{unit}/%^{power}" if power > 1 else f"{unit}/%" if power else unit,
                )
            )
    share = part.get("C")
    rows.append(
        (
            "C",
            "share of the fast part",
            number(published.TABLE_III["C"][0], 2),
            number(share, 2),
            interval(ci.get("C")),
            *((number(two.get("C"), 2), "–") if two else ()),
            "1",
        )
    )
    return Table(
        "Table III",
        "The nonlinear model: τ1(u), τ2(u) and T_s(u) as polynomials of the duty u in %. The published T_s "
        "gives 0.057 N·m "
        "at full duty, where the paper's own figures show about 4 N·m.",
        (
            "symbol",
            "belongs to",
            "published",
            f"ours, {used} (used)" if two else "ours",
            "95 % interval",
            *((f"ours, {beside_name}", "95 % interval") if two else ()),
            "unit",
        ),
        tuple(rows),
    )


def linear_table(fit: Mapping[str, Any]) -> Table:
    """Eq. (8): a0, b0, c0."""
    part = fit["linear"]
    ci = part.get("ci95") or {}
    unit, out = unit_of_input(fit), unit_of_output(fit)
    units = {"a0": "1/s", "b0": f"{out}/(s·{unit or 'input'})", "c0": f"{out}/s"}
    rows = tuple(
        (name, number(published.LINEAR[name], 3), number(part.get(name)), interval(ci.get(name)), unit)
        for name, unit in units.items()
    )
    return Table(
        "Linear model, Eq. (8)",
        "dT/dt = −a0 T + b0 u + c0, fitted to all levels at once.",
        ("symbol", "published", "ours", "95 % interval", "unit"),
        rows,
    )


def levels_table(fit: Mapping[str, Any]) -> Table:
    """The friction curve of each level."""
    part = fit["friction"]
    force = (fit.get("data") or {}).get("kind") == "friction-force"
    rig = apparatus_of(fit.get("data") or {})
    unit, out = unit_of_input(fit), unit_of_output(fit)
    rows = []
    for row in part.get("levels") or []:
        ci, words = row.get("ci95") or {}, row.get("words") or {}
        cells = [level(row["level"])]
        if force:
            cells.append(number(rig.stress_kpa(row["level"]), 3))
        for name in ("Ts", "tau1", "tau2"):
            said = words.get(name)
            cells += [number(row[name]), interval(ci.get(name)) if ci.get(name) or not said else str(said)]
        rows.append((*cells, number(row.get("rmse"), 3)))
    columns = [headed("level", unit), *(["stress (kPa)"] if force else [])]
    for name in ("Ts", "tau1", "tau2"):
        columns += [f"{SYMBOLS[name]} ({out if name == 'Ts' else UNITS[name]})", "95 % interval"]
    caption = f"One curve fitted to each level by itself.{_intervals_words(fit)}"
    return Table("Single levels, Eq. (3)", caption, (*columns, f"RMSE ({out})"), tuple(rows))


def _intervals_words(fit: Mapping[str, Any]) -> str:
    """How the 95 % intervals were found, as sentences after a caption."""
    said = fit.get("uncertainty") or {}
    if not said.get("ci"):
        return ""
    why = f" {said['why'][:1].upper()}{said['why'][1:]}." if said.get("why") else ""
    return f" Intervals: {said['ci']}, {said.get('means', '')}.{why}"


def input_gain_table(fit: Mapping[str, Any]) -> Table:
    """Eq. (8) fitted to each level: a0, steady torque, B."""
    part = fit["linear"]
    bounds = part.get("bounds") or {}
    rows = tuple(
        tuple(
            number(row.get(key)) if key != "level" else level(row["level"])
            for key in ("level", "a0", "gain", "b0", "c0", "B", "rmse")
        )
        for row in part.get("per_level") or []
    )
    caption = (
        f"The linear model fitted to each level by itself; convention {bounds.get('convention', 'unknown')}. "
        f"B_m = {number(bounds.get('B_m'))} and B_M = {number(bounds.get('B_M'))} are the least and the largest B "
        "of the levels kept; published 12.4 and 42.6."
    )
    unit, out = unit_of_input(fit), unit_of_output(fit)
    columns = (
        headed("level", unit), "a0 (1/s)", f"steady value ({out})", "b0", f"c0 ({out}/s)",
        f"B ({unit or 'input'}·s/({out}))", f"RMSE ({out})",
    )  # fmt: skip
    return Table("Input gain of each level", caption, columns, rows)


def table_iv(gains: Mapping[str, Any]) -> Table:
    """The robust controller's parameters."""
    rc = gains.get("rc") or {}
    meaning = {
        "B_m": ("%·s/(N·m)", "least input gain B that the design allows for"),
        "B_M": ("%·s/(N·m)", "largest input gain B that the design allows for"),
        "Q_M": ("N·m/s", "steepest torque reference"),
        "phi": ("as entered in Eq. (15)", "bound on the error of the model's drift term"),
        "epsilon": ("1", "half width of the layer where the robust term is linear"),
        "gamma": ("1", "sharpness of the switch at that layer's edge"),
        "K_D": ("1/s", "gain on the torque error"),
        "K_P": ("1/s²", "gain on the integral of the torque error"),
    }
    names = {"phi": "φ", "epsilon": "ε", "gamma": "γ"}
    rows = tuple(
        (names.get(key, key), number(published.TABLE_IV[key], 3), number(rc.get(key)), unit, text)
        for key, (unit, text) in meaning.items()
    )
    return Table("Table IV", "The robust controller.", ("symbol", "published", "ours", "unit", "what it does"), rows)


def gains_table(gains: Mapping[str, Any]) -> Table:
    """What follows from Table IV's parameters: B̂, α, ρ, Q; and the PI."""
    rc, pi = gains.get("rc") or {}, gains.get("pi") or {}
    rho = rc.get("rho") or {}
    q = rc.get("Q") or []
    rows = [
        ("B̂", "12.5", number(rc.get("B_hat")), "%·s/(N·m)", "input gain that the controller assumes"),
        ("α by Eq. (16)", "0.5491", number(rc.get("alpha")), "1", "(B_M − B_m)/(B_M + B_m)"),
        ("α reached", "–", number(rc.get("alpha_reached")), "1", "largest |1 − b B̂| over the range of B"),
        ("ρ, constant", "10.81", number(rho.get("constant")), "N·m/s", "size of the robust term without error"),
        ("ρ, slope", "6.586", number(rho.get("slope")), "per ‖ξ‖", "how the robust term grows with the error"),
    ]
    if len(q) == 2:
        rows.append(
            ("Q12, Q22", "–", f"{number(q[0][1])}, {number(q[1][1])}", "1", "weights of the switching variable z")
        )
    rows += [
        ("PI: K_P", "21", number(pi.get("K_P")), "%/(N·m)", "gain on the torque error"),
        ("PI: K_I", "360", number(pi.get("K_I")), "%/(N·m·s)", "gain on the integral of the torque error"),
        (
            "PI: overshoot",
            "1",
            number(pi.get("overshoot_pct"), 3),
            "%",
            "as reached on the linear model; the paper states 1",
        ),
        (
            "PI: settling time",
            "0.27",
            number(pi.get("settling_s"), 3),
            "s",
            "to within 2 %, as reached on the linear model",
        ),
    ]
    return Table(
        "Gains that follow",
        "What the parameters of Table IV and the linear model give.",
        ("symbol", "published", "ours", "unit", "what it is"),
        tuple(rows),
    )
