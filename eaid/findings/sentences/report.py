"""Sentences about result files and the report."""

from eaid.findings.row import Row

ROWS: dict[str, Row] = {
    "result-written-anew": Row(
        "note", "{subject}: another program has written it anew: its digest no longer fits and is passed over"
    ),
    "part-left-out": Row("caution", "{subject}: its {part} has no {key} and is left out"),
}
