"""Whether the results can be trusted, in plain words: the solver's verdict, warnings, and what the data cannot tell."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from eaid.fitting.stored import not_identifiable_because
from eaid.report.results import Fit, Results, synthetic_of
from eaid.report.tables import KINDS, SYMBOLS, number

GOOD, CARE, BAD = "good", "care", "bad"
MODELS = {
    "friction": "friction curves",
    "nonlinear": "nonlinear model",
    "linear": "linear model",
    "release": "release constants",
}
WIDE = 0.3
"""Half-width of a 95 % interval, as a share of its value, from which the value is called weakly known."""


@dataclass(frozen=True)
class Point:
    """One thing to know: how grave it is (good, care or bad), what it is about, and the sentence."""

    grade: str
    about: str
    text: str


@dataclass(frozen=True)
class Verdict:
    """The headline of the page and the points behind it, the gravest first."""

    grade: str
    headline: str
    points: tuple[Point, ...]

    @property
    def groups(self) -> list[tuple[str, str, list[str]]]:
        """Grade, subject and sentences, one entry per subject and grade."""
        found: dict[tuple[str, str], list[str]] = {}
        for point in self.points:
            found.setdefault((point.grade, point.about), []).append(point.text)
        return [(grade, about, texts) for (grade, about), texts in found.items()]


def verdict(results: Results) -> Verdict:
    """Judge all results of a page together."""
    points: list[Point] = []
    for fit in results.fits:
        points += _of_fit(fit, several=len(results.fits) > 1)
    for gains in results.gains:
        points += _of_gains(gains.content)
    for replay in results.replays:
        points += [_said(f"replay {replay.scenario}", text) for text in _texts(replay.options.get("warnings"))]
    for data in results.data:
        doubtful = sum(1 for run in data.steps.runs if run.warnings)
        if doubtful:
            said = f"{doubtful} of {len(data.steps.runs)} runs are doubtful; the table of runs says why"
            points.append(_said(f"data, {data.source.path}", said))
        points += [_said(f"data, {data.source.path}", text) for text in data.steps.warnings]
    if made_by := synthetic_of(results):
        points.append(_said("data", f"synthetic ({made_by}): nothing here was measured on a rig"))
    points = list(dict.fromkeys(points))
    order = {BAD: 0, CARE: 1, GOOD: 2}
    points.sort(key=lambda point: order[point.grade])
    subjects = Counter(grade for grade, _ in dict.fromkeys((point.grade, point.about) for point in points))
    if subjects[BAD]:
        which = _listed(list(dict.fromkeys(point.about for point in points if point.grade == BAD)))
        return Verdict(BAD, f"Do not rely on this yet: settle what is said of the {which} first.", tuple(points))
    if subjects[CARE]:
        models = list(dict.fromkeys(point.about for point in points if point.grade == CARE and point.about != "data"))
        if not models:
            return Verdict(CARE, "Consistent in itself, but made from synthetic data.", tuple(points))
        many = "one reservation" if len(models) == 1 else f"reservations on {len(models)} subjects"
        return Verdict(CARE, f"Usable within the recorded range, with {many}: read them below.", tuple(points))
    if not results.fits:
        return Verdict(GOOD, "No fit was given, so there is nothing to judge here.", tuple(points))
    return Verdict(GOOD, "Can be trusted within the recorded range.", tuple(points))


def _of_fit(fit: Fit, several: bool) -> Iterator[Point]:
    content = fit.content
    of = f", {KINDS.get(fit.kind, (fit.kind, ''))[0]} ({fit.source.path})" if several else ""
    settled = []
    found = [(name, content[key]) for key, name in MODELS.items() if isinstance(content.get(key), Mapping)]
    for key, (name, part) in zip([k for k in MODELS if isinstance(content.get(k), Mapping)], found, strict=True):
        solver = part.get("solver") or {}
        about = f"{name}{of}"
        if solver.get("converged") is False:
            reason = solver.get("message", "no reason given")
            yield _said(about, f"did not converge ({reason}); do not use the values", BAD)
        elif solver.get("converged"):
            settled.append(name)
        if part.get("identifiable") is False:
            why = "; ".join(not_identifiable_because(dict(content), key))
            yield _said(about, f"these data cannot settle it: {why}", BAD)
        texts = [*_texts(part.get("warnings")), *_texts(part.get("open"))]
        if held := [str(one) for one in solver.get("at_bounds") or []]:
            limit = "a limit" if len(held) == 1 else "limits"
            yield _said(about, f"leans on {limit} ({'; '.join(held)}): the data pull beyond what is physical there")
            texts = [text for text in texts if not text.startswith("a constraint holds the fit")]
        for text in texts:
            yield _said(about, text)
    told = {text for _name, part in found for key in ("warnings", "open") for text in _texts(part.get(key))}
    for text in _texts(content.get("warnings")):
        if text not in told:
            yield _said(f"fit{of}", text)
    yield from _what_data_cannot_tell(content, of)
    if settled:
        yield _said(f"{_listed(settled)}{of}", "best fit reached: a test of our own finds nothing lower nearby", GOOD)
    if not found:
        yield _said(f"fit{of}", "the file holds no model", BAD)


def _what_data_cannot_tell(content: Mapping[str, Any], of: str) -> Iterator[Point]:
    data = content.get("data") or {}
    sources = [source for source in data.get("sources") or [] if isinstance(source, Mapping)]
    repeats = Counter(source.get("level") for source in sources if source.get("edge") != "falling")
    if repeats and min(repeats.values()) < 2:
        yield _said(
            f"data{of}", "some levels were recorded once only: how much a repeat would differ is not known there"
        )
    levels = (content.get("friction") or {}).get("levels") or []
    about = f"friction curves{of}"
    if (record_s := _record_s(data)) and levels:
        slow = [row["level"] for row in levels if isinstance(row.get("tau2"), int | float) and row["tau2"] > record_s]
        told = [text for name in MODELS for text in _texts((content.get(name) or {}).get("warnings"))]
        if slow and "longer than the record" not in " ".join(told):
            said = f"the slow time constant is longer than the recording ({number(record_s, 3)} s)"
            yield _said(about, f"at {_levels(slow)} {said}: hold the level longer, or do not quote τ2 and T_s there")
    for name in ("Ts", "tau1", "tau2"):
        wide = []
        for row in levels:
            ends = (row.get("ci95") or {}).get(name)
            if ends and None not in ends and row.get(name) and (ends[1] - ends[0]) / 2 > WIDE * abs(row[name]):
                wide.append(row["level"])
        if wide:
            said = f"{SYMBOLS[name]} is weakly known at {_levels(wide)}: its 95 % interval is wider than ±30 %"
            yield _said(about, said)
    misfits = [row["level"] for row in _lack_of_fit(content) if row.get("beyond")]
    if misfits:
        said = (
            "a single curve misses its data by more than the scatter of repeats explains: its shape is not quite right"
        )
        yield _said(about, f"at {_levels(misfits)} {said}")


def _record_s(data: Mapping[str, Any]) -> float | None:
    """Shortest recording after a step [s], where the file tells it."""
    if lengths := [value for value in data.get("record_s") or [] if isinstance(value, int | float)]:
        return float(min(lengths))
    rate = data.get("sample_rate_hz")
    samples = [
        source["samples"]
        for source in data.get("sources") or []
        if isinstance(source, Mapping)
        and isinstance(source.get("samples"), int | float)
        and source.get("edge") != "falling"
    ]
    return float(min(samples) / rate) if rate and samples else None


def _lack_of_fit(content: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    adequacy = (content.get("uncertainty") or {}).get("adequacy") or {}
    return [row for row in adequacy.get("lack_of_fit") or [] if isinstance(row, Mapping)]


def _of_gains(content: Mapping[str, Any]) -> Iterator[Point]:
    rc = content.get("rc") or {}
    if rc.get("guaranteed") is True:
        said = "large enough for the inequality (15), if the bounds φ and Q_M are true"
        yield _said("robust gains", said, GOOD)
    elif rc.get("guaranteed") is False:
        said = "stability is not guaranteed by the inequality (15): the robust term is smaller than it asks for"
        yield _said("robust gains", f"{said}; the replays show how the loop behaves all the same")
    for text in _texts(content.get("warnings")):
        yield _said("PI gains" if "PI" in text.split(":")[0] else "robust gains", text)


def _said(about: str, text: str, grade: str = CARE) -> Point:
    """A point as a sentence, with the symbols that the page uses."""
    for name, symbol in SYMBOLS.items():
        text = re.sub(rf"\b{name}\b", symbol, text)
    return Point(grade, about, f"{text[:1].upper()}{text[1:].rstrip('.')}." if text[:1] not in "τφρ" else f"{text}.")


def _listed(texts: list[str]) -> str:
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} and {texts[-1]}"


def _levels(levels: list[float]) -> str:
    texts = [f"{level:.4g}" for level in levels]
    return f"{'level' if len(texts) == 1 else 'levels'} {_listed(texts)}"


def _texts(warnings: Any) -> list[str]:
    if isinstance(warnings, str):
        return [line for line in warnings.splitlines() if line]
    return [str(text) for text in warnings or []]
