"""Sentences about recorded."""

from eaid.findings.row import Row

ROWS: dict[str, Row] = {}
