"""Sentences about control."""

from eaid.findings.row import Row

ROWS: dict[str, Row] = {}
