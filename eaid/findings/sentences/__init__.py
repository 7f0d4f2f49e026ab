"""The one table of sentences: code → severity and template."""

from eaid.findings.sentences import control, fitting, logs

SENTENCES = logs.ROWS | fitting.ROWS | control.ROWS
if len(SENTENCES) < len(logs.ROWS) + len(fitting.ROWS) + len(control.ROWS):
    raise ValueError("a code of a finding stands in two parts of the table")
