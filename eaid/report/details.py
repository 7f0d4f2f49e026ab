"""Tables behind the figures: levels of a fit, runs of a dataset, the guarantee's terms, margins."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from eaid.report import estimates, tables
from eaid.report.results import Data, Fit
from eaid.report.tables import Table, number


def details(fit: Fit, called: str) -> list[Table]:
    """All tables of one fit: single levels, input gain, release, held-out levels, which shape and degree."""
    found = []
    content = fit.content
    if (content.get("friction") or {}).get("levels"):
        found.append(tables.levels_table(content))
    if (content.get("linear") or {}).get("per_level"):
        found.append(tables.input_gain_table(content))
    if isinstance(release := content.get("release"), Mapping) and release.get("levels"):
        found.append(release_table(release, tables.unit_of_input(content)))
    if held := held_out(content):
        found.append(held)
    found += estimates.estimates(content)
    found += estimates.huber(content)
    found += adequacy(content)
    return [replace(table, heading=f"{table.heading}: {called}") for table in found]


def release_table(part: Mapping[str, Any], unit: str = "%") -> Table:
    """Time constants of the falling edges, pooled and of each level."""
    rows = [
        (
            "all together",
            number(part.get("tau1")),
            number(part.get("tau2")),
            "–",
            "–",
            number(part.get("rmse"), 3),
        )
    ]
    rows += [
        (
            f"{tables.level(row.get('level'))} {unit}".rstrip(),
            number(row.get("tau1")),
            number(row.get("tau2")),
            number(row.get("amplitude")),
            number(row.get("residual"), 3),
            number(row.get("rmse"), 3),
        )
        for row in part.get("levels") or []
    ]
    return Table(
        "Release",
        "How torque falls after the duty returns to zero; the replays use the pooled constants.",
        ("level", "τ1 (s)", "τ2 (s)", "falls by (N·m)", "is left (N·m)", "RMSE (N·m)"),
        tuple(rows),
    )


def held_out(content: Mapping[str, Any]) -> Table | None:
    """Errors on levels that were not fitted; None where none was held out."""
    rows = []
    for name in ("friction", "nonlinear", "linear"):
        part = (content.get(name) or {}).get("hold_out")
        if isinstance(part, Mapping):
            for row in part.get("levels") or []:
                error = row.get("abs_error") or {}
                rows.append(
                    (
                        name,
                        tables.level(row.get("level")),
                        number(row.get("rmse"), 3),
                        number(error.get("mean"), 3),
                        number(part.get("fitted_rmse"), 3),
                    )
                )
    if not rows:
        return None
    return Table(
        "Levels held out",
        "Levels that the fit never saw, predicted by the model from the others.",
        ("model", "level", "RMSE (N·m)", "mean |error| (N·m)", "RMSE on the fitted levels"),
        tuple(rows),
    )


def runs(data: Data) -> Table:
    """One row per recorded step of a dataset, with what is doubtful in it."""
    rows = [
        (
            run.name,
            tables.level(run.level),
            str(run.repeat),
            run.edge,
            str(run.samples),
            number(run.rate_hz, 4),
            number(run.baseline_nm, 3),
            "; ".join(run.warnings) or "nothing",
        )
        for run in data.steps.runs
    ]
    unit = data.steps.input_unit
    return Table(
        f"Runs of {data.source.path}",
        "One row per recorded step. The idle torque is the mean before the step; it is subtracted before fitting.",
        (
            "run",
            f"level ({unit})" if unit else "level",
            "repeat",
            "edge",
            "samples",
            "rate (Hz)",
            f"idle ({data.steps.output_unit})",
            "doubtful",
        ),
        tuple(rows),
        formulas=False,
    )


def guarantee(gains: Mapping[str, Any]) -> list[Table]:
    """The terms of inequality (15) and whether each bound in it is a true one."""
    rc = gains.get("rc") or {}
    rho = rc.get("rho") or {}
    needed = rho.get("needed") or {}
    bound = rc.get("ultimate_bound") or {}
    rows = [
        ("α by Eq. (16), and reached with this B̂", f"{number(rc.get('alpha'))}, {number(rc.get('alpha_reached'))}"),
        ("ρ as it is", f"{number(rho.get('constant'))} + {number(rho.get('slope'))} ‖ξ‖ N·m/s"),
        (
            "ρ that the α reached asks for",
            f"{number(needed.get('constant'))} + {number(needed.get('slope'))} ‖ξ‖ N·m/s",
        ),
        ("so inequality (15) holds", _plain(rc.get("guaranteed"))),
        ("φ as entered means a duty of", f"{number(rc.get('phi_honest_pct'))} %"),
        ("the data ask for a duty of", f"{number(rc.get('phi_needed_pct'))} %"),
        ("so φ is a true bound on this plant", _plain(rc.get("phi_holds"))),
        ("Q_M is a true bound on the reference", _plain(rc.get("Q_M_holds"))),
        ("torque error that the theory bounds in the end", f"{number(bound.get('torque_error_nm'))} N·m"),
        ("largest torque error in the replayed sum of sines", f"{number(bound.get('replayed_nm'))} N·m"),
    ]
    shown = tuple(row for row in rows if row[1].split()[0].rstrip(",") != "–")
    if not shown:
        return []
    return [
        Table(
            "The guarantee's terms",
            "Inequality (15): ρ ≥ (α Q_M + α ‖K‖ ‖ξ‖ + B_M φ)/(1 − α). It needs α, φ and Q_M to be true bounds.",
            ("term", "value"),
            shown,
        )
    ]


def margins(gains: Mapping[str, Any]) -> list[Table]:
    """Gain, phase and delay margins of both controllers around held duties."""
    found = gains.get("margins") or {}
    rows = []
    for point in found.get("points") or []:
        cells = [tables.level(point.get("duty_pct")), number(point.get("torque_nm"), 3)]
        for name in ("rc", "pi"):
            one = point.get(name) or {}
            delay = one.get("delay_s")
            cells += [
                number(one.get("gain_db"), 3),
                number(one.get("phase_deg"), 3),
                number(1e3 * delay, 3) if isinstance(delay, int | float) else "–",
            ]
        rows.append(tuple(cells))
    if not rows:
        return []
    return [
        Table(
            "Margins",
            "How much the loop's gain may grow, its phase may lag, and its delay may grow before it becomes "
            "unstable, around a held duty.",
            (
                "duty (%)",
                "torque (N·m)",
                "RC: gain (dB)",
                "phase (°)",
                "delay (ms)",
                "PI: gain (dB)",
                "phase (°)",
                "delay (ms)",
            ),
            tuple(rows),
        )
    ]


def adequacy(content: Mapping[str, Any]) -> list[Table]:
    """Is the model right: the recommendation, the lack of fit, which curve suits a level and which degree a value."""
    judged = (content.get("uncertainty") or {}).get("adequacy") or {}
    found = []
    if judged.get("recommended"):
        found.append(_recommended(judged, tables.unit_of_input(content), tables.unit_of_output(content)))
    if shapes := judged.get("shapes"):
        rows = tuple(
            (
                str(row.get("name")),
                number(row.get("parameters"), 1),
                number(row.get("rmse"), 3),
                number(row.get("aicc"), 6),
            )
            for row in shapes
        )
        found.append(
            Table(
                "Which shape",
                "Curves tried on each level. AICc weighs closeness against the number of values fitted: the "
                "least is best, differences below about 4 say little.",
                ("curve", "values a level", "RMSE (N·m)", "AICc"),
                rows,
            )
        )
    if orders := judged.get("orders"):
        degrees = tuple(
            (
                tables.SYMBOLS.get(str(row.get("parameter")), str(row.get("parameter"))),
                number(row.get("order"), 1),
                number(row.get("chi_square"), 4),
                number(row.get("aicc"), 4),
                number(row.get("leave_one_out_pct"), 3),
            )
            for row in orders
        )
        found.append(
            Table(
                "Which degree",
                "Polynomials of the duty tried for each value. The last column is the typical error when a "
                "level is left out and predicted from the others.",
                ("value", "degree", "χ²", "AICc", "left-out error (%)"),
                degrees,
            )
        )
    return found


def _recommended(judged: Mapping[str, Any], unit: str, out: str) -> Table:
    """The one recommended sentence, over each level's lack of fit against the spread of its repeats."""
    advice = str(judged["recommended"])
    caption = (
        f"Recommended: {advice}. The ratio is what a level's curve misses over what its repeats scatter; beyond what "
        "chance allows, the curve's shape is not quite right there, by the systematic part."
    )
    rows = [
        (
            f"{tables.level(row.get('level'))} {unit}".rstrip(),
            number(row.get("ratio"), 3),
            number(row.get("chance"), 3),
            _plain(row.get("beyond")),
            number(row.get("systematic_nm"), 2),
        )
        for row in judged.get("lack_of_fit") or []
    ]
    for label, key in (
        ("residual autocorrelation, one sample apart", "residual_autocorrelation"),
        ("samples that count as independent", "effective_samples"),
        (f"error on a level left out ({out})", "leave_one_level_out_nm"),
    ):
        if judged.get(key) is not None:
            rows.append((label, number(judged[key], 3), "", "", ""))
    columns = ("level", "ratio", "by chance up to", "beyond", f"systematic part ({out})")
    return Table("Is the model right", caption, columns, tuple(rows))


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return "–" if value is None else str(value)
