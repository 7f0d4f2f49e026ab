"""Sentences about logs."""

from eaid.findings.row import Row

ROWS: dict[str, Row] = {}
