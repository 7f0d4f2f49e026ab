"""Sessions: the control chart of a rig, and sessions on top of each other."""

import numpy as np

from eaid.report import panels as ink
from eaid.report.panels import Axis, Band, Line, Panel, Sheet, Span, over
from eaid.report.results import Results
from eaid.sessions.compare import Comparison
from eaid.sessions.rig import Rig

SESSION_COLOURS = (ink.BLUE, ink.VERMILLION, ink.GREEN, ink.PURPLE, ink.ORANGE, ink.SKY, ink.BLACK)
MARKERS = "osD^v<>"
LONGEST = 12  # Letters of a session's name below the chart
# Of which an axis shows the three largest that it holds
FACTORS = (1.01, 1.02, 1.05, 1.1, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0, 100.0)


def control_panel(rig: Rig) -> Panel:
    """Each session's gain over the common one, with what the next one's may be at the middle level."""
    model, names = rig.main.model(rig.names), rig.names
    sessions, gain, error = model.gains()
    at, end = sessions + 1, len(names) + 1.0
    middle = rig.main.next[len(model.knots) // 2]
    reach, level = middle.factor, f"{middle.level:.4g} {rig.input_unit}".rstrip()
    ends = np.exp(gain - 1.96 * error), np.exp(gain + 1.96 * error)
    x = np.array([0.5, end + 0.5])
    lines = [
        Line(x, [1.0, 1.0], "", ink.GREY, width=0.8),
        Line(at, np.exp(gain), "session, 95 %", ink.BLUE, "", marker="o", ends=ends, size=4.5),
        Line([end], [1.0], f"next at {level}, 95 %", ink.VERMILLION, "", marker="D", size=4.5,
             ends=(np.array([1 / reach]), np.array([reach]))),
    ]  # fmt: skip
    shown = [*(name if len(name) <= LONGEST else f"{name[: LONGEST - 1]}…" for name in names), "next"]
    marks = [one for one in FACTORS if one < max(reach, *ends[1], *(1 / ends[0]))][-3:]
    factors = {1.0: "1"} | {one: f"×{one:g}" for one in marks} | {1 / one: f"÷{one:g}" for one in marks}
    x_axis = Axis("Session", ticks=dict(enumerate(shown, 1)), limits=(0.5, end + 0.5))
    y_axis = Axis(f"{rig.symbol} over the common one", log=True, ticks=factors)
    band = Band(x, np.full(2, 1 / reach), np.full(2, reach), ink.VERMILLION, 0.12)
    return Panel(x_axis, y_axis, lines, [band], legend="above", tight=False)


def levels_panel(rig: Rig) -> Panel:
    """Every session over the level, with the next one's intervals."""
    one, unit = rig.main, rig.input_unit
    level = np.array([row.level for row in one.next])
    low, high = (np.array([getattr(row, name) for row in one.next]) for name in ("low", "high"))
    lines: list[Line] = []
    for name in rig.names:
        rows = sorted((value.level, value.value) for value in one.values if value.session == name)
        if rows:
            at, values = zip(*rows, strict=True)
            lines.append(Line(at, values, "" if lines else "session", ink.BLUE, marker="o", size=2.6, alpha=0.55))
    lines.append(Line(level, [row.value for row in one.next], "next, 95 %", ink.VERMILLION, "--", width=1.2))
    band = Band(level, low, high, ink.VERMILLION, 0.15)
    return Panel(over(unit), Axis(rig.symbol, one.unit, log=True), lines, [band], legend="above", tight=False)


def chart(results: Results) -> Sheet | None:
    """The control chart, and the sessions over the level."""
    if not results.rigs:
        return None
    rig = results.rigs[0].result
    return Sheet([control_panel(rig), levels_panel(rig)], 2.9, columns=2, shared=False)


def values_panel(found: Comparison) -> Panel:
    """T_s of every session over the level, on top of each other."""
    lines = []
    for k, (letter, values) in enumerate(found.values.items()):
        x, y, reach = np.array([(one.level, one.value, 1.96 * one.sd_log) for one in values]).reshape(-1, 3).T
        ends, colour = (y * np.exp(-reach), y * np.exp(reach)), SESSION_COLOURS[k % len(SESSION_COLOURS)]
        lines.append(Line(x, y, letter, colour, width=1.1, marker=MARKERS[k % len(MARKERS)], ends=ends))
    y_axis = Axis("T_s", found.output_unit, (0.0, None))
    return Panel(over(found.input_unit), y_axis, lines, legend="above", columns=4, tight=False)


def changes_panel(found: Comparison) -> Panel:
    """A over each other session, level by level, each drawn as in the panel of the values."""
    lines, letters = [], list(found.values)
    for one in (shift for shift in found.shifts if shift.quantity == "Ts"):
        k = letters.index(one.against)
        x, y, low, high = np.array([(c.level, c.ratio, c.low, c.high) for c in one.levels]).T
        colour, marker = SESSION_COLOURS[k % len(SESSION_COLOURS)], MARKERS[k % len(MARKERS)]
        lines.append(Line(x, y, one.against, colour, "", marker=marker, ends=(low, high)))
    spans = [Span(1.0, 1.0, ink.GREY, "y", 0.8)]
    return Panel(over(found.input_unit), Axis("T_s of A over the others'"), lines, spans=spans, tight=False)


def sessions_compared(results: Results) -> Sheet | None:
    """Sessions on top of each other, and by what factor they differ."""
    found = next((one.result for one in results.comparisons if one.result.values), None)
    if found is None:
        return None
    return Sheet([values_panel(found), changes_panel(found)], 2.7, columns=2, shared=False)
