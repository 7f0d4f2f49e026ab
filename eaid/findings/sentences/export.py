"""Sentences about export."""

from eaid.findings.row import Row

ROWS: dict[str, Row] = {}
