"""The numbers of the paper's table, by the parts of the paper: what `claims.md.j2` puts into its rows."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array
from eaid.control import robust
from eaid.control.gains import paper_gains
from eaid.models.parameters import PAPER_LINEAR, REFERENCE_PLANT, Linear
from eaid.report import published
from eaid.report.paper.evidence import TUNED_PI, Evidence
from eaid.report.tables import SYMBOLS, number
from eaid.report.tables.fits import formula
from eaid.results.fit import Fit
from eaid.results.friction import FrictionLevel, Trend
from eaid.results.metrics import ToneMetrics

TESTED = {("soft", "hard"): 0.001, ("soft", "assisted"): 0.005, ("hard", "assisted"): 0.005}
"""Modes whose difference the paper tests → the p that it prints."""
TERMS = {2: ("slope", "offset"), 4: ("p in p e^(r x) + q e^(s x)", "r", "q", "s")}
"""Number of a trend's coefficients → how they are called."""
COMES_BACK = 0.3
"""Largest difference of a coefficient from the printed one, as a share of it, to say that it comes back."""
polyval = np.polynomial.polynomial.polyval


def numbers(found: Evidence) -> Mapping[str, object]:
    """All of them by name."""
    return {
        **of_trends(found),
        **of_table_iii(found),
        **of_models(found),
        **of_control(found),
        **of_rehabilitation(found),
    }


def of_trends(found: Evidence) -> Mapping[str, object]:
    """Tables I and II beside the trends of noise-free fits and of the shipped logs.

    The shipped force logs are made of T_s, τ1 and τ2 of Table I, the speed logs of T_s and τ1 of Table II as printed,
    and of τ2 = 5.4 e^(−0.0101 Ω) s.
    """
    stress = np.array([row.stress_kpa for row in _levels(found.force)])
    speed = np.array([row.level for row in _levels(found.speed)], dtype=float)
    force, rpm = (found.exact["friction-force"], found.force), (found.exact["friction-speed"], found.speed)
    slow = _trends(found.speed)["tau2"]
    return {
        "trends": [
            *(_trend("Table I", name, force, stress) for name in published.TABLE_I),
            *(_trend("Table II", name, rpm, speed) for name in ("Ts", "tau1")),
        ],
        "low_stress": {
            "printed": float(published.OVER_STRESS["C_f"](stress[:1])[0]), "by_torque": _levels(force[0])[0].C_f,
        },
        "equal_rates": {
            "terms": list(zip(TERMS[4], published.TABLE_II["tau2"][1], strict=True)),
            "formula": formula(slow, "Ω"), "rmse": slow.rmse,
        },
    }  # fmt: skip


def _trend(table: str, name: str, fits: tuple[Fit, Fit], x: Array) -> Mapping[str, object]:
    """The coefficients of one printed trend and its RMSE, beside the noise-free fit's and the shipped logs'."""
    first = table == "Table I"
    _text, printed, rmse = (published.TABLE_I if first else published.TABLE_II)[name]
    curve = (published.OVER_STRESS if first else published.OVER_SPEED)[name](x)
    trends = [_trends(fit)[name] for fit in fits]
    ours = [_ordered(trend.coefficients, printed) for trend in trends]
    terms = []
    for i, (term, value) in enumerate(zip(TERMS[len(printed)], printed, strict=True)):
        exact, shipped = (c[i] if len(c) == len(printed) else None for c in ours)
        said = [
            f"{t.form} instead," if c is None else number(c, 3) for t, c in zip(trends, (exact, shipped), strict=True)
        ]
        terms.append(
            {"term": term, "printed": value, "exact": said[0], "shipped": said[1], "back": _back(shipped, value)}
        )
    return {
        "table": table, "kind": fits[0].data.kind, "symbol": SYMBOLS[name], "terms": terms, "rmse": rmse,
        "our_rmse": trends[1].rmse,
        "apart": [100 * float(np.max(np.abs(trend.predict(x) / curve - 1))) for trend in trends],
    }  # fmt: skip


def _ordered(coefficients: Sequence[float], printed: Sequence[float]) -> list[float]:
    """A sum of two exponentials with its terms in the printed order, by their rates: a sum has no order of its own."""
    c = list(coefficients)
    swapped = [*c[2:], *c[:2]]

    def apart(terms: list[float]) -> float:
        return abs(terms[1] - printed[1]) + abs(terms[3] - printed[3])

    return swapped if len(c) == 4 and apart(swapped) < apart(c) else c


def _back(ours: float | None, printed: float) -> bool:
    return ours is not None and abs(ours - printed) <= COMES_BACK * abs(printed)


def of_table_iii(found: Evidence) -> Mapping[str, object]:
    """The nonlinear model's coefficients; the reference plant has τ1 and τ2 as printed."""
    part, exact = found.clutch.nonlinear, found.exact["clutch"].nonlinear
    assert part is not None and exact is not None
    u = np.array([row.level for row in part.per_level], dtype=float)
    polynomials = []
    for letter, name in (("a", "tau1"), ("b", "tau2")):
        printed, ours, returned = published.TABLE_III[name], getattr(part, name), getattr(exact, name)
        alone = np.array([getattr(row, name) for row in _levels(found.clutch)])
        single, believed = (100 * float(np.max(np.abs(y / polyval(u, printed) - 1))) for y in (alone, polyval(u, ours)))
        terms = [
            {"printed": value, "exact": r, "shipped": c, "back": _back(c, value)}
            for value, r, c in zip(printed, returned, ours, strict=True)
        ]
        polynomials.append(
            {"letter": letter, "symbol": SYMBOLS[name], "terms": terms, "single": single, "believed": believed}
        )
    steady = published.TABLE_III["Ts"]
    return {"polynomials": polynomials, "steady": steady, "steady_at_100": float(polyval(100.0, steady))}


def of_models(found: Evidence) -> Mapping[str, object]:
    """§II to §IV: the apparatus, friction, the models of the clutch, Table IV."""
    force, speed = _levels(found.force), _levels(found.speed)
    gains, _pi = paper_gains()
    rpm = np.linspace(5, 40, 3501)
    at = np.array(Apparatus().stress_kpa(86.0))
    return {
        "rig": Apparatus(),
        "full": float(polyval(100.0, REFERENCE_PLANT.Ts)),
        "force": force,
        "worst_pct": 100 * max((row.rmse or 0.0) / row.Ts for row in force),
        "lowest_rpm": float(rpm[np.argmin(published.OVER_SPEED["Ts"](rpm))]),
        "span": {name: _spans(rows) for name, rows in (("force", force), ("speed", speed))},
        "at_86n": {key: float(published.OVER_STRESS[key](at)) for key in ("tau1", "tau2")},
        "at_15rpm": float(published.OVER_SPEED["tau1"](np.array(15.0))),
        "nonlinear": found.clutch.nonlinear,
        "linear": found.clutch.linear,
        "pooled_20s": found.pooled_20s,
        "pooled_60s": found.pooled_60s,
        "published_at": [f"{u:.0f}" for u in crossings(PAPER_LINEAR)],
        "refitted_at": [f"{u:.0f}" for u in crossings(found.pooled_20s.parameters)],
        "negative_below": -PAPER_LINEAR.c0 / PAPER_LINEAR.b0,
        "gains": gains,
        "honest_phi": robust.honest_phi_pct("paper", 0.05, 12.4, 42.6),
        "jump": float(1 + np.tanh(-gains.gamma * gains.epsilon)),
        "alpha": robust.alpha_formula(12.4, 42.6),
        "reached": robust.alpha_reached(12.5, 12.4, 42.6),
    }


def _levels(fit: Fit) -> tuple[FrictionLevel, ...]:
    return fit.friction.levels if fit.friction is not None else ()


def _trends(fit: Fit) -> dict[str, Trend]:
    return fit.friction.trends if fit.friction is not None else {}


def _spans(rows: Sequence[FrictionLevel]) -> dict[str, float]:
    """By how much each time constant changes over the levels [s]."""
    return {key: float(np.ptp([getattr(row, key) for row in rows])) for key in ("tau1", "tau2")}


def crossings(model: Linear) -> list[float]:
    """Duties [%] at which the linear model's steady torque is the reference plant's T_s."""
    u = np.linspace(10, 100, 90001)
    gap = (model.b0 * u + model.c0) / model.a0 - polyval(u, REFERENCE_PLANT.Ts)
    return [float(u[i]) for i in np.flatnonzero(np.diff(np.sign(gap)))]


def of_control(found: Evidence) -> Mapping[str, object]:
    """§V-B, §VI and Figs. 11 to 13."""
    error = {name: one.max_abs_error_nm or np.nan for name, one in found.multisine.items()}
    tones = {name: {row.frequency_hz: row for row in one.frequencies} for name, one in found.sweep.items()}
    steps = {name: one.steps for name, one in found.steps.items()}
    # the last step falls by itself: no controller can speed it up
    rises = {name: [one.rise_time_s for one in rows[:-1] if one.rise_time_s] for name, rows in steps.items()}
    return {
        "multisine": found.multisine,
        "steps": found.steps,
        "tones": tones,
        "tuned": TUNED_PI,
        "pi_printed": found.pi_printed,
        "pi_tuned": found.pi_tuned,
        "less": {name: 100 * (1 - error["rc"] / error[name]) for name in ("pi", "pi-tuned")},
        "rise": {name: float(np.mean(values)) for name, values in rises.items()},
        "overshoot": {name: max(one.overshoot_pct or 0.0 for one in rows) for name, rows in steps.items()},
        "to_1hz_db": max(abs(row.gain_db or 0.0) for f, row in tones["rc"].items() if f <= 1.0),
        "peak": max(tones["pi"].values(), key=lambda row: row.gain_db or 0.0),
        "band": {name: _bandwidth(rows) for name, rows in tones.items()},
        "mean_error": {
            name: float(np.mean([row.mean_abs_error_nm or 0.0 for row in tones[name].values()]))
            for name in ("rc", "pi")
        },
    }


def _bandwidth(rows: Mapping[float, ToneMetrics]) -> str:
    """First crossing of −3 dB, by straight lines between tones."""
    points = sorted((f, row.gain_db or 0.0) for f, row in rows.items())
    if points[0][1] < -3:
        return f"below {points[0][0]:g} Hz"
    for (f0, g0), (f1, g1) in itertools.pairwise(points):
        if g1 < -3 <= g0:
            return f"{number(float(f0 + (f1 - f0) * (g0 + 3) / (g0 - g1)), 2)} Hz"
    return f"above {points[-1][0]:g} Hz"


def of_rehabilitation(found: Evidence) -> Mapping[str, object]:
    """§VII and Figs. 16, 17, on a simulated limb, RC with the published gains, seed 0.

    Modes are compared by movements, which are independent observations, as many as it takes.
    """
    few, more = ({test.modes: test for test in part.tests} for part in (found.rehab, found.longer))
    pairs = [(pair, printed, few[pair], more[pair].cycles) for pair, printed in TESTED.items()]
    return {"modes": found.rehab.modes, "pairs": pairs}
