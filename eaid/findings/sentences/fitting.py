"""Sentences about fitting."""

from eaid.findings.row import Row

ROWS: dict[str, Row] = {}
