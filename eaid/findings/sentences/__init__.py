"""The one table of sentences: code → severity and template, a module a room."""

from importlib import import_module

from eaid.findings.row import Row

ROOMS = (
    *("logs", "steps", "fitting", "uncertainty", "control", "replay", "recorded", "planning", "coupling", "export"),
    "report",
)


def _table() -> dict[str, Row]:
    found: dict[str, Row] = {}
    for room in ROOMS:
        rows: dict[str, Row] = import_module(f"eaid.findings.sentences.{room}").ROWS
        if again := found.keys() & rows.keys():
            raise ValueError(f"codes that stand in two rooms: {', '.join(sorted(again))}")
        found |= rows
    return found


SENTENCES = _table()
