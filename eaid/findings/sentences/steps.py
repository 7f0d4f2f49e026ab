"""Sentences about steps."""

from eaid.findings.row import Row

ROWS: dict[str, Row] = {}
