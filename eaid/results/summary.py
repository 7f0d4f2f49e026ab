"""A fit in eight lines: how well it follows, T_s, τ1 and τ2 where it matters, which estimate, what is doubtful."""

from typing import TYPE_CHECKING

from eaid.findings import merged, ranked, say
from eaid.shown import counted, span

if TYPE_CHECKING:
    from eaid.results.fit import Fit
    from eaid.results.friction import FrictionLevel
    from eaid.results.nonlinear import CurveLevel

SYMBOLS = {"Ts": "T_s", "tau1": "τ1", "tau2": "τ2"}
ENDLESS_S = 1e4
"""A time constant above this [s] that no interval bounds is no number worth showing."""
BECAUSE = {
    "asked": ", as asked for",
    "agree": ": the two agree within their intervals",
    "apart": ": the joint one lies outside its intervals",
    "weak": ": too few levels determine their own curve for the two-stage one",
    "alone": ": there is no other",
}
"""Why an estimate stands as the nonlinear model."""


def fit_summary(fit: "Fit", findings: int = 3) -> list[str]:
    """The lines that answer first: what was fitted, fit %, values with 95 % intervals, the gravest findings."""
    data = fit.data
    runs = sum(data.repeats) or len(data.sources)
    made = ", synthetic" if data.synthetic else ""
    lines = [f"{data.kind}: {span(data.levels, data.input_unit)}; {counted(runs, 'run')}{made}"]
    lines.append(f"fit    {_fit_pct(fit)}")
    levels = believed_levels(fit)
    rows = [levels[k] for k in sorted({0, len(levels) // 2, len(levels) - 1})] if levels else []
    if rows:
        units = {"Ts": data.output_unit or "unit unknown", "tau1": "s", "tau2": "s"}
        heading = [
            f"level [{data.input_unit}]" if data.input_unit else "level",
            *(f"{symbol} [{units[name]}]" for name, symbol in SYMBOLS.items()),
        ]
        cells = [heading, *([f"{row.level:.4g}", *(_value(row, name) for name in SYMBOLS)] for row in rows)]
        widths = [max(len(row[i]) for row in cells) for i in range(len(heading))]
        lines += ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in cells]
    if fit.nonlinear is not None and levels is not fit.nonlinear.curves:
        lines.append("shown  each level's own curve: the nonlinear model's are not estimable")
    elif fit.nonlinear is not None:
        lines.append(f"taken  the {fit.nonlinear.estimator} estimate{BECAUSE.get(fit.nonlinear.because, '')}")
    worst = ranked(merged(fit.findings))[:findings]
    lines += [f"{one.severity}: {say(one)}" for one in worst]
    return lines


def _fit_pct(fit: "Fit") -> str:
    said = []
    for name in ("nonlinear", "linear"):
        part = getattr(fit, name)
        if part is not None and part.fit_pct is not None:
            said.append(f"{name} {part.fit_pct:.1f} %")
    own = [row.fit_pct for row in (fit.friction.levels if fit.friction is not None else ()) if row.fit_pct is not None]
    if own:
        said.append(f"single levels {' … '.join(f'{one:.1f}' for one in sorted({min(own), max(own)}))} %")
    return ", ".join(said) or "not known"


def believed_levels(fit: "Fit") -> "tuple[CurveLevel, ...] | tuple[FrictionLevel, ...]":
    """T_s, τ1 and τ2 by level: the nonlinear model's curves, where any has an interval, else each level's own."""
    curves = fit.nonlinear.curves if fit.nonlinear is not None else ()
    own = tuple(row for row in (fit.friction.levels if fit.friction is not None else ()) if row.from_ == 0)
    return (
        own if own and not any(_quoted(row) for row in curves) and any(_quoted(row) for row in own) else curves or own
    )


def _quoted(row: "CurveLevel | FrictionLevel") -> bool:
    return row.ci95 is not None and any(getattr(row.ci95, name) is not None for name in SYMBOLS)


def _value(row: "CurveLevel | FrictionLevel", name: str) -> str:
    value = getattr(row, name)
    ends = getattr(row.ci95, name) if row.ci95 is not None else None
    if value is None:
        return "not known"
    if ends is None and name != "Ts" and value > ENDLESS_S:
        return "not estimable"
    return f"{value:.3g} ({ends[0]:.3g} … {ends[1]:.3g})" if ends is not None else f"{value:.3g} (not estimable)"
