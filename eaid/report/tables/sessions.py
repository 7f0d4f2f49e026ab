"""Tables of sessions: what the next one may be, how they differ, what moved."""

from eaid.findings.row import NUMBER_NAMES
from eaid.report.tables import INTERVAL, Table, level, table_of
from eaid.sessions.compare import CALLED, Comparison
from eaid.sessions.rig import Rig


def next_table(rig: Rig) -> Table:
    """The next session's main quantity at every level."""
    one = rig.main
    stepped = () if rig.confounded else ((("with one step ×/÷", "", 3), "with_step"),)
    note = "" if rig.confounded else f"; with one step: after one reference step at {rig.best_step}"
    return table_of(
        "The next session", f"{rig.symbol} with 95 % intervals{note}", one.next,
        (("level", rig.input_unit), lambda row: level(row.level)), ((rig.symbol, one.unit, 3), "value"),
        (INTERVAL, lambda row: (row.low, row.high)), (("×/÷", "", 3), "factor"), *stepped,
    )  # fmt: skip


def scatter_table(rig: Rig) -> Table:
    """How the sessions differ, by quantity."""
    return table_of(
        "How sessions differ", "Standard deviations of the logarithm: 0.1 is about 10 %", rig.quantities.items(),
        ("quantity", lambda of: NUMBER_NAMES.get(of[0], of[0])), (("gain", "", 3), lambda of: of[1].sd.gain),
        (("tilt over ln level", "", 3), lambda of: of[1].sd.tilt),
        (("session × level", "", 3), lambda of: of[1].sd.level), (("one run", "", 3), lambda of: of[1].sd_step),
    )  # fmt: skip


def shifts_table(found: Comparison) -> Table:
    """What moved: the shift that all levels share, and whether they do."""
    return table_of(
        "What moved", "A over the other session; p after Holm", found.shifts,
        ("quantity", lambda one: CALLED[one.quantity]),
        ("against", "against"),
        (("ratio", "", 3), "ratio"), (INTERVAL, lambda one: (one.low, one.high)),
        ("moved", "moved"), (("p", "", 2), "p"),
        ("alike at all levels", "alike"), (("p alike", "", 2), "p_alike"),
    )  # fmt: skip


def changes_table(found: Comparison) -> Table:
    """By what factor A lies above the others at every level."""
    rows = [(shift, one) for shift in found.shifts for one in shift.levels]
    return table_of(
        "Changes by level", "A over the other session", rows,
        ("quantity", lambda of: CALLED[of[0].quantity]), ("against", lambda of: of[0].against),
        (("level", found.input_unit), lambda of: level(of[1].level)), (("ratio", "", 3), lambda of: of[1].ratio),
        (INTERVAL, lambda of: (of[1].low, of[1].high)),
    )  # fmt: skip


def promise_table(found: Comparison) -> Table:
    """A recorded loop against what was promised."""
    one = found.promise
    unit = one.unit if one is not None else ""
    return table_of(
        "Recorded loop against its promise", "95 %: what drawn plants do", one.rows if one is not None else (),
        ("", "name"), (("recorded", unit, 3), "recorded"), (("promised", unit, 3), "promised"),
        (INTERVAL, lambda row: None if row.low is None or row.high is None else (row.low, row.high)), ("kept", "kept"),
    )  # fmt: skip
