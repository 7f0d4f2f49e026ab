"""A fit in eight lines: how well it follows, T_s, τ1 and τ2 where it matters, which estimate, what is doubtful."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from eaid.findings import merged, ranked, say
from eaid.shown import counted, span

if TYPE_CHECKING:
    from eaid.results.fit import CurveLevel, Fit, FrictionLevel

SYMBOLS = {"Ts": "T_s", "tau1": "τ1", "tau2": "τ2"}
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
    rows = _rows(fit)
    if rows:
        units = {"Ts": data.output_unit or "unit unknown", "tau1": "s", "tau2": "s"}
        heading = [
            f"level [{data.input_unit}]" if data.input_unit else "level",
            *(f"{symbol} [{units[name]}]" for name, symbol in SYMBOLS.items()),
        ]
        cells = [heading, *([f"{row.level:g}", *(_value(row, name) for name in SYMBOLS)] for row in rows)]
        widths = [max(len(row[i]) for row in cells) for i in range(len(heading))]
        lines += ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in cells]
    if fit.nonlinear is not None:
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


def _rows(fit: "Fit") -> "list[CurveLevel | FrictionLevel]":
    """The lowest, the middle and the highest level: of the nonlinear model's curves, else of the single levels."""
    found: Sequence[CurveLevel | FrictionLevel] = fit.nonlinear.curves if fit.nonlinear is not None else ()
    if not found:
        found = fit.friction.levels if fit.friction is not None else ()
    kept = sorted({0, len(found) // 2, len(found) - 1}) if found else []
    return [found[i] for i in kept]


def _value(row: "CurveLevel | FrictionLevel", name: str) -> str:
    value = getattr(row, name)
    ends = getattr(row.ci95, name) if row.ci95 is not None else None
    if value is None:
        return "not known"
    return f"{value:.3g} ({ends[0]:.3g} … {ends[1]:.3g})" if ends is not None else f"{value:.3g} (not estimable)"
