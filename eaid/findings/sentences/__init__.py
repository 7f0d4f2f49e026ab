"""The one table of sentences: code → severity and template."""

from eaid.findings.sentences import control, fitting, logs, sessions

SENTENCE_TABLES = (logs.ROWS, fitting.ROWS, control.ROWS, sessions.ROWS)
SENTENCES = {code: row for part in SENTENCE_TABLES for code, row in part.items()}
if len(SENTENCES) < sum(map(len, SENTENCE_TABLES)):
    raise ValueError("a code of a finding stands in two parts of the table")
