"""Sentences about report."""

from eaid.findings.row import Row

ROWS: dict[str, Row] = {}
