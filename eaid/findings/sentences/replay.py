"""Sentences about replay."""

from eaid.findings.row import Row

ROWS: dict[str, Row] = {}
