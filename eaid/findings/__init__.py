"""What is worth knowing about a result: findings are data, and their sentences stand in one table."""

from eaid.findings.finding import Finding, Value, advised, enumerated, finding, merged, ranked, say, sentences, stops
from eaid.findings.row import Severity

__all__ = [
    "Finding",
    "Severity",
    "Value",
    "advised",
    "enumerated",
    "finding",
    "merged",
    "ranked",
    "say",
    "sentences",
    "stops",
]  # fmt: skip
