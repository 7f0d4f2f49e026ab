"""Two fits of one kind as a table: both values, their intervals, and whether scatter explains the change."""

from typing import Any

from eaid.report import tables
from eaid.report.results import Fit
from eaid.report.tables import KINDS, Table, interval, number


def compare(first: Fit, second: Fit) -> Table:
    """Values of two fits of one kind: both, their difference, and whether the intervals touch."""
    rows: list[tuple[str, ...]] = []

    def add(name: str, unit: str, a: Any, b: Any, ends_a: Any = None, ends_b: Any = None) -> None:
        if not isinstance(a, int | float) or not isinstance(b, int | float):
            return
        change = f"{100 * (b / a - 1):+.1f} %".replace("-", "−") if a else "–"
        said = "–"
        if _is_interval(ends_a) and _is_interval(ends_b):
            said = "yes" if ends_a[1] < ends_b[0] or ends_b[1] < ends_a[0] else "no"
        rows.append((f"{name} ({unit})", number(a), interval(ends_a), number(b), interval(ends_b), change, said))

    one, two = first.content, second.content
    for key, unit in (("a0", "1/s"), ("b0", "N·m/(s·%)"), ("c0", "N·m/s")):
        a, b = one.get("linear") or {}, two.get("linear") or {}
        add(key, unit, a.get(key), b.get(key), (a.get("ci95") or {}).get(key), (b.get("ci95") or {}).get(key))
    for key in ("B_m", "B_M"):
        a, b = ((part.get("linear") or {}).get("bounds") or {} for part in (one, two))
        add(key, "%·s/(N·m)", a.get(key), b.get(key))
    for part in ("nonlinear", "linear"):
        add(f"RMSE of the {part} model", "N·m", (one.get(part) or {}).get("rmse"), (two.get(part) or {}).get("rmse"))
    levels = [{row["level"]: row for row in (part.get("friction") or {}).get("levels") or []} for part in (one, two)]
    unit_of_level = KINDS.get(first.kind, ("", ""))[1]
    for level in sorted(set(levels[0]) & set(levels[1])):
        a, b = levels[0][level], levels[1][level]
        for key in ("Ts", "tau1", "tau2"):
            add(
                f"{tables.SYMBOLS[key]} at {tables.level(level)} {unit_of_level}",
                tables.UNITS[key],
                a.get(key),
                b.get(key),
                (a.get("ci95") or {}).get(key),
                (b.get("ci95") or {}).get(key),
            )
    return Table(
        "Both fits",
        f"A is {first.source.path}, B is {second.source.path}.",
        ("value", "A", "A, 95 %", "B", "B, 95 %", "change", "beyond both intervals"),
        tuple(rows),
    )


def _is_interval(ends: Any) -> bool:
    return isinstance(ends, list | tuple) and len(ends) == 2 and all(isinstance(end, int | float) for end in ends)
