"""Sentences about coupling."""

from eaid.findings.row import Row

ROWS: dict[str, Row] = {}
