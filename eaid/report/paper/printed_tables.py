"""Tables I to III, coefficient by coefficient."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from eaid.arrays import Array
from eaid.report import published
from eaid.report.figures.values import trend_values
from eaid.report.paper.claim import CIRCULAR, FAILS, FIT, HERE, HOLDS, NO_RIG, Claim, near
from eaid.report.paper.evidence import Evidence
from eaid.report.tables import SYMBOLS, number
from eaid.report.tables.fits import formula
from eaid.results.fit import Fit
from eaid.results.friction import Friction

TREND_TERMS = ("p in p e^(r x) + q e^(s x)", "r", "q", "s")
COMES_BACK = 0.3
"""Largest difference of a coefficient from the printed one, as a share of it, to say that it comes back."""
EXACT = 0.02
"""Largest difference of a noise-free trend from the printed one, as a share of it, to call it the same."""
SCATTER = "it is the scatter of the paper's own rig about its trend; ours is that of the synthetic runs"
FORCE, SPEED, CLUTCH = (FIT.format(kind) for kind in ("friction-force", "friction-speed", "clutch"))


def _friction(fit: Fit) -> Friction:
    assert fit.friction is not None
    return fit.friction


def tables(found: Evidence) -> list[Claim]:
    """Every entry of Tables I to III."""
    return [*table_i(found), *table_ii(found), *table_iii(found)]


def _ordered(coefficients: Sequence[float], printed: Sequence[float]) -> list[float]:
    """A sum of two exponentials with its terms in the printed order, by their rates: a sum has no order of its own."""
    c = list(coefficients)
    swapped = [*c[2:], *c[:2]]

    def apart(terms: list[float]) -> float:
        return abs(terms[1] - printed[1]) + abs(terms[3] - printed[3])

    return swapped if len(c) == 4 and apart(swapped) < apart(c) else c


def _back(ours: float | None, printed: float) -> str:
    return "comes back" if ours is not None and near(ours, printed, COMES_BACK) else "does NOT come back"


def _of_trend(table: str, name: str, fits: tuple[Fit, Fit], x: Array, command: str) -> list[Claim]:
    """The coefficients of one printed trend and its RMSE, beside the noise-free fit's and the shipped logs'."""
    printed, paper = (
        (published.TABLE_I, published.OVER_STRESS) if table == "Table I" else (published.TABLE_II, published.OVER_SPEED)
    )
    _text, coefficients, rmse = printed[name]
    count, curve, symbol = len(coefficients), paper[name](x), SYMBOLS[name]
    trends = [_friction(fit).trends[name] for fit in fits]
    ours = [_ordered(trend.coefficients, coefficients) for trend in trends]
    apart = [100 * float(np.max(np.abs(trend_values(trend, x) / curve - 1))) for trend in trends]
    claims = []
    for i, (term, value) in enumerate(
        zip(("slope", "offset") if count == 2 else TREND_TERMS, coefficients, strict=True)
    ):
        said = [
            f"{number(c[i], 3)} {of}" if len(c) == count else f"{trend.form} instead, {of}"
            for trend, c, of in zip(trends, ours, ("noise-free", "shipped logs"), strict=True)
        ]
        verdict = CIRCULAR
        why = "the logs are made of it; from the shipped ones, whose runs scatter, it "
        why += f"{_back(ours[1][i] if len(ours[1]) == count else None, value)} "
        why += f"(the {'line' if count == 2 else 'curve'} is within {apart[1]:.0f} % of the printed one)"
        if apart[0] > 100 * EXACT:
            verdict = FAILS
            why = f"even noise-free logs of the other printed formulas give a curve up to {apart[0]:.0f} % away from it"
        claims.append(Claim(table, f"{symbol}, {term} = {number(value, 4)}", ", ".join(said), command, verdict, why))
    ours_rmse = number(trends[1].rmse, 2)
    return [*claims, Claim(table, f"{symbol}, fit RMSE = {number(rmse, 3)}", ours_rmse, command, NO_RIG, SCATTER)]


def table_i(found: Evidence) -> list[Claim]:
    """Friction over stress; the shipped force logs are made from T_s, τ1 and τ2 of this table as printed."""
    x = np.array([row.stress_kpa for row in _friction(found.force).levels])
    fits = found.exact["friction-force"], found.force
    claims = []
    for name in published.TABLE_I:
        rows = _of_trend("Table I", name, fits, x, FORCE)
        if name == "C_f":
            printed = float(published.OVER_STRESS["C_f"](x[:1])[0])
            by_torque = _friction(fits[0]).levels[0].C_f
            why = f"{printed:.3f} at 2.7 kPa, where the printed T_s gives {by_torque:.3f}; they agree from 14 kPa up"
            rows = [replace(row, verdict=FAILS, why=why) if "RMSE" not in row.printed else row for row in rows]
        claims += rows
    return claims


def table_ii(found: Evidence) -> list[Claim]:
    """Friction over speed; the shipped speed logs take T_s and τ1 as printed, τ2 = 5.4 e^(−0.0101 Ω) s."""
    x = np.array([row.level for row in _friction(found.speed).levels], dtype=float)
    fits = found.exact["friction-speed"], found.speed
    claims = [claim for name in ("Ts", "tau1") for claim in _of_trend("Table II", name, fits, x, SPEED)]
    trend = _friction(found.speed).trends["tau2"]
    shown = formula(trend, "Ω")
    why = (
        "two equal rates with huge opposite weights: at the printed digits only 100 e^(−0.0507 Ω) is left, "
        "46.7 s at 15 RPM where Table I has 4.64 s"
    )
    for term, value in zip(TREND_TERMS, published.TABLE_II["tau2"][1], strict=True):
        claims.append(Claim("Table II", f"τ2, {term} = {number(value, 4)}", shown, SPEED, FAILS, why))
        shown, why = "as above", "as above"
    claims.append(Claim("Table II", "τ2, fit RMSE = 0.850", number(trend.rmse, 2), SPEED, NO_RIG, SCATTER))
    return claims


def table_iii(found: Evidence) -> list[Claim]:
    """The nonlinear model's coefficients; the reference plant has τ1 and τ2 as printed."""
    part, exact = found.clutch.nonlinear, found.exact["clutch"].nonlinear
    assert part is not None and exact is not None
    u = np.array([row.level for row in part.per_level], dtype=float)
    polyval = np.polynomial.polynomial.polyval
    claims = []
    for letter, name in (("a", "tau1"), ("b", "tau2")):
        printed, symbol = published.TABLE_III[name], SYMBOLS[name]
        truth = polyval(u, printed)
        alone = np.array([getattr(row, name) for row in _friction(found.clutch).levels])
        single, believed = (
            100 * float(np.max(np.abs(y / truth - 1))) for y in (alone, polyval(u, getattr(part, name)))
        )
        for power, value in enumerate(printed):
            shipped, returned = getattr(part, name)[power], getattr(exact, name)[power]
            ours = f"{number(returned, 3)} noise-free, {number(shipped, 3)} shipped logs"
            why = "the plant has it and noise-free logs return it; from the shipped, whose runs scatter, it "
            why += f"{_back(shipped, value)}: {symbol} of single levels is within {single:.0f} %, of the "
            why += f"{part.estimator} one within {believed:.0f} %"
            said = f"{letter}_{power} = {number(value, 3)} ({symbol})"
            claims.append(Claim("Table III", said, ours, CLUTCH, CIRCULAR, why))
    why = "the printed T_s(u) gives 0.057 N·m at full duty, where Figs. 7 to 13 and the linear model say about 4 N·m; "
    why += "the reference plant has another cubic"
    for power, value in enumerate(published.TABLE_III["Ts"]):
        said = f"c_{power} = {number(value, 3)} (T_s)"
        claims.append(Claim("Table III", said, number(part.Ts[power], 3), CLUTCH, FAILS, why))
    held = "held at this value, as the paper does"
    full = f"{number(float(polyval(100.0, published.TABLE_III['Ts'])), 2)} N·m"
    return [
        *claims,
        Claim("Table III", "C = 0.85", number(part.C, 2), CLUTCH, HOLDS, held),
        Claim("Table III", "T_s at full duty, by its polynomial", full, HERE, FAILS, "see c_0 to c_3"),
    ]
