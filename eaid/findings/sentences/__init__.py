"""The one table of sentences: code → severity and template."""

from eaid.findings.row import Row
from eaid.findings.sentences import control, fitting, logs

PARTS: tuple[dict[str, Row], ...] = (
    logs.LOG_ROWS, logs.STEP_ROWS, fitting.FIT_ROWS, fitting.INTERVAL_ROWS, fitting.RECORDED_ROWS, fitting.PLAN_ROWS,
    control.GAIN_ROWS, control.REPLAY_ROWS, control.WALL_ROWS, control.EXPORT_ROWS, control.REPORT_ROWS,
)  # fmt: skip
SENTENCES = {code: row for part in PARTS for code, row in part.items()}
if len(SENTENCES) < sum(map(len, PARTS)):
    raise ValueError("a code of a finding stands in two parts of the table")
