"""Sentences about uncertainty."""

from eaid.findings.row import Row

ROWS: dict[str, Row] = {}
