"""A finding: a code, how grave it is, what it is about, and the numbers behind it."""

import re
import string
from collections.abc import Iterable, Sequence
from typing import Any

import msgspec

from eaid.errors import in_python
from eaid.findings.row import SYMBOLS, Row, Severity
from eaid.findings.sentences import SENTENCES
from eaid.shown import counted

Value = float | int | str | bool | None | tuple[float | str, ...]
GRAVITY: dict[str, int] = {"stop": 0, "caution": 1, "note": 2}
WORD = {"stop": "stop", "caution": "warning", "note": "note"}  # How a severity is called wherever people read it
MOST_TOLD = 3  # Findings that are told with an answer; the rest on request
MOST_LISTED = 6  # Numbers that a sentence lists one by one


class Finding(msgspec.Struct, frozen=True):
    """One thing that a result's reader has to know; the sentence is rendered last, by `say`."""

    code: str
    """Kebab-case; the key of the table of sentences."""
    severity: Severity
    subject: str
    """What it is about: a model (friction, nonlinear, linear, release), data, a run's name, rc, pi, a scenario."""
    levels: tuple[float, ...] = ()
    """Levels it concerns, in the input's unit."""
    values: dict[str, Value] = {}
    """Numbers and names that the sentence shows."""


def finding(code: str, subject: str, levels: Iterable[float] = (), **values: Value) -> Finding:
    """A finding of a code, with the severity that the table gives it; raises KeyError for a code without a row."""
    return Finding(code, SENTENCES[code].severity, subject, tuple(float(u) for u in levels), values)


def ranked(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """The gravest first, and of one severity by the table's `rank`; those alike keep their order."""
    return tuple(sorted(findings, key=lambda one: (GRAVITY[one.severity], _row_of_code(one.code).rank)))


def merged(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """One finding for all of one code: the worst by the table's `size`, with the number of the `others`; codes that
    another one `covers` are left out."""
    groups: dict[str, list[Finding]] = {}
    for one in findings:
        groups.setdefault(one.code, []).append(one)
    covered = {less for code in groups for less in _row_of_code(code).covers}
    worst = []
    for code, group in groups.items():
        if code not in covered:
            size = _row_of_code(code).size
            one = max(group, key=lambda each: _number_text(each.values.get(size)))  # the first of those alike
            others = {"others": len(group) - 1} if len(group) > 1 else {}
            worst.append(msgspec.structs.replace(one, values={**one.values, **others}))
    return tuple(worst)


def advised(findings: Iterable[Finding], typed: Sequence[str]) -> tuple[str, str]:
    """What the gravest of a fit's findings asks for before gains are built on it: by hand, or by options of another fit
    that was not `typed` with them; both empty where none asks for anything."""
    every = ranked(merged(tuple(findings)))
    codes = {one.code for one in every}
    for one in every:
        row = _row_of_code(one.code)
        if row.first or (row.refit and row.unless not in codes and row.refit.split()[0] not in typed):
            return row.first, row.refit.format(**one.values)
    return "", ""


def _row_of_code(code: str) -> Row:
    """The table's row of a code; one that says nothing where a later version made the finding."""
    return SENTENCES.get(code, Row("note", code))


def _number_text(value: Value) -> float:
    return abs(float(value)) if isinstance(value, int | float) else 0.0


def stops(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Those of severity stop."""
    return tuple(one for one in findings if one.severity == "stop")


class CountingFormat(string.Formatter):
    """`str.format` that also counts: `{runs:#run}` is `1 run`, or `3 runs`; of what is not known it says so, and of
    several numbers each."""

    def format_field(self, value: Any, spec: str) -> Any:
        """The field, counted where its format begins with `#`."""
        if value is None or value != value:
            return "unknown"
        if isinstance(value, tuple):
            return " and ".join(self.format_field(one, spec) for one in value)
        return counted(value, spec[1:]) if spec.startswith("#") else super().format_field(value, spec)


def say(finding: Finding) -> str:
    """The sentence of a finding, options still in guillemets; its code where the table has no row for it."""
    row = SENTENCES.get(finding.code)
    if row is None:
        return finding.code
    levels, parameter = enumerated(finding.levels), finding.values.get("parameter")
    unit = str(finding.values.get("unit") or "")
    fields = {
        **finding.values, "subject": finding.subject, "each": finding.levels, "levels": levels,
        "at": f"at {enumerated(finding.levels, unit)}",
        "symbol": SYMBOLS.get(str(parameter), parameter),
    }  # fmt: skip
    said = row.template(fields) if callable(row.template) else CountingFormat().vformat(row.template, (), fields)
    said = re.sub(r" +(?=[,;:] )", "", said)  # where a unit is empty
    others = finding.values.get("others")
    return f"{said} (and {others} more)" if others else said


def sentences(findings: Iterable[Finding]) -> list[str]:
    """The sentences of some findings as Python writes options (`rest=`), for files and notebooks."""
    return [in_python(say(one)) for one in findings]


def enumerated(items: Sequence[float | str], unit: str = "") -> str:
    """`10, 20 and 30 %`; of many numbers the first and the last."""
    texts = [item if isinstance(item, str) else f"{item:.4g}" for item in items]
    if len(texts) > MOST_LISTED and not isinstance(items[0], str):
        return f"{texts[0]} … {f'{texts[-1]} {unit}'.rstrip()} ({len(texts)} of them)"
    every = ", ".join(texts[:-1]) + f" and {texts[-1]}" if len(texts) > 1 else "".join(texts)
    return f"{every} {unit}".rstrip()
