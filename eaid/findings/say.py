"""Findings → sentences, rendered last: nothing else in the program reads them."""

import re
import string
from collections.abc import Iterable, Sequence
from typing import Any

from eaid.errors import in_python
from eaid.findings.finding import Finding
from eaid.findings.row import SYMBOLS
from eaid.findings.sentences import SENTENCES
from eaid.shown import counted


class Words(string.Formatter):
    """`str.format` that also counts: `{runs:#run}` is `1 run`, or `3 runs`."""

    def format_field(self, value: Any, spec: str) -> Any:
        """The field, counted where its format begins with `#`."""
        return counted(value, spec[1:]) if spec.startswith("#") else super().format_field(value, spec)


MOST_LISTED = 6
"""Numbers that a sentence lists one by one."""


def say(finding: Finding) -> str:
    """The sentence of a finding, options still in guillemets; its code where the table has no row for it."""
    row = SENTENCES.get(finding.code)
    if row is None:
        return finding.code
    levels, parameter = listed(finding.levels), finding.values.get("parameter")
    fields = {
        **finding.values, "subject": finding.subject, "each": finding.levels, "levels": levels,
        "at": f"at {levels} {finding.values.get('unit') or ''}".rstrip(),
        "symbol": SYMBOLS.get(str(parameter), parameter),
    }  # fmt: skip
    said = row.template(fields) if callable(row.template) else Words().vformat(row.template, (), fields)
    said = re.sub(r" +(?=[,;:] )", "", said)  # where a unit is empty
    others = finding.values.get("others")
    return f"{said} (and {others} more)" if others else said


def sentences(findings: Iterable[Finding]) -> list[str]:
    """The sentences of some findings as Python writes options (`rest=`), for files and notebooks."""
    return [in_python(say(one)) for one in findings]


def listed(items: Sequence[float | str]) -> str:
    """`10, 20 and 30`; of many numbers the first and the last."""
    texts = [item if isinstance(item, str) else f"{item:.4g}" for item in items]
    if len(texts) > MOST_LISTED and not isinstance(items[0], str):
        return f"{texts[0]} … {texts[-1]} ({len(texts)} of them)"
    return ", ".join(texts[:-1]) + f" and {texts[-1]}" if len(texts) > 1 else "".join(texts)
