"""Sentences about result files and the report."""

from eaid.findings.row import Row, caution, note

ROWS: dict[str, Row] = {
    "result-written-anew": note(
        "{subject}: another program has written it anew: its digest no longer fits and is passed over"
    ),
    "part-left-out": caution("{subject}: its {part} has no {key} and is left out"),
}
