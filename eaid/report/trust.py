"""Whether the results can be trusted, in plain words: the solver's verdict, warnings, and what the data cannot tell."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from eaid.report.results import Fit, Results, synthetic_of
from eaid.report.tables import SYMBOLS, UNITS, number

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
    """One thing to know, and how grave it is: good, care or bad."""

    grade: str
    text: str


@dataclass(frozen=True)
class Verdict:
    """The headline of the page and the points behind it, the gravest first."""

    grade: str
    headline: str
    points: tuple[Point, ...]


def verdict(results: Results) -> Verdict:
    """Judge all results of a page together."""
    points: list[Point] = []
    for fit in results.fits:
        points += _of_fit(fit, several=len(results.fits) > 1)
    for gains in results.gains:
        points += _of_gains(gains.content)
    for replay in results.replays:
        points += [Point(CARE, f"Replay {replay.scenario}: {text}") for text in _texts(replay.options.get("warnings"))]
    for data in results.data:
        doubtful = [run for run in data.steps.runs if run.warnings]
        if doubtful:
            points.append(
                Point(
                    CARE,
                    f"{data.source.path}: {len(doubtful)} of {len(data.steps.runs)} runs are doubtful; the "
                    "table of runs says why.",
                )
            )
        points += [Point(CARE, f"{data.source.path}: {text}") for text in data.steps.warnings]
    if made_by := synthetic_of(results):
        points.append(Point(CARE, f"The data are synthetic ({made_by}): nothing here was measured on a rig."))
    points = list(dict.fromkeys(points))
    order = {BAD: 0, CARE: 1, GOOD: 2}
    points.sort(key=lambda point: order[point.grade])
    counts = Counter(point.grade for point in points)
    if counts[BAD]:
        many = "one finding" if counts[BAD] == 1 else f"{counts[BAD]} findings"
        return Verdict(BAD, f"Do not rely on this yet: {many} below must be settled first.", tuple(points))
    if counts[CARE]:
        many = "one reservation" if counts[CARE] == 1 else f"{counts[CARE]} reservations"
        return Verdict(CARE, f"Usable, with {many}.", tuple(points))
    if not results.fits:
        return Verdict(GOOD, "No fit was given, so there is nothing to judge here.", tuple(points))
    return Verdict(GOOD, "Can be trusted within the recorded range.", tuple(points))


def _of_fit(fit: Fit, several: bool) -> Iterator[Point]:
    content = fit.content
    where = f"{fit.source.path}: " if several else ""
    found = False
    settled = []
    for key, name in MODELS.items():
        part = content.get(key)
        if not isinstance(part, Mapping):
            continue
        found = True
        solver = part.get("solver") or {}
        if solver.get("converged") is False:
            yield Point(
                BAD,
                f"{where}The {name} did not converge ({solver.get('message', 'no reason given')}); do not "
                "use its values.",
            )
        elif solver.get("converged"):
            settled.append(name)
        for held in solver.get("at_bounds") or []:
            yield Point(
                CARE, f"{where}The {name} leans on a limit ({held}): the data pull beyond what is physical there."
            )
        if part.get("identifiable") is False:
            why = "; ".join(_texts(part.get("not_identifiable_because"))) or "no reason given"
            yield Point(BAD, f"{where}These data cannot settle the {name}: {why}.")
        for text in dict.fromkeys([*_texts(part.get("warnings")), *_texts(part.get("open"))]):
            yield Point(CARE, f"{where}{name[0].upper()}{name[1:]}: {text}.".replace("..", "."))
    for text in _texts(content.get("warnings")):
        yield Point(CARE, f"{where}{text[0].upper()}{text[1:]}.".replace("..", "."))
    misfits = [row["level"] for row in _lack_of_fit(content) if row.get("beyond")]
    if misfits:
        yield Point(
            CARE,
            f"{where}At {_listed(misfits)} a single curve misses its data by more than the scatter of "
            "repeats explains: the shape itself is not quite right there.",
        )
    if settled:
        names = settled[0] if len(settled) == 1 else f"{', '.join(settled[:-1])} and {settled[-1]}"
        yield Point(
            GOOD,
            f"{where}Best fit reached for the {names}: the solver stopped there, and a test of our own finds "
            "nothing lower nearby.",
        )
    if not found:
        yield Point(BAD, f"{where}The file holds no model.")
    yield from _what_data_cannot_tell(content, where)


def _what_data_cannot_tell(content: Mapping[str, Any], where: str) -> Iterator[Point]:
    data = content.get("data") or {}
    sources = [source for source in data.get("sources") or [] if isinstance(source, Mapping)]
    repeats = Counter(source.get("level") for source in sources if source.get("edge") != "falling")
    if repeats and min(repeats.values()) < 2:
        yield Point(
            CARE, f"{where}Some levels were recorded once only: how much a repeat would differ is not known there."
        )
    levels = (content.get("friction") or {}).get("levels") or []
    if (record_s := _record_s(data)) and levels:
        slow = [row["level"] for row in levels if isinstance(row.get("tau2"), int | float) and row["tau2"] > record_s]
        said = " ".join(
            _texts((content.get("nonlinear") or {}).get("warnings"))
            + _texts((content.get("friction") or {}).get("warnings"))
        )
        if slow and "longer than the record" not in said:
            yield Point(
                CARE,
                f"{where}At {_listed(slow)} the slow time constant is longer than the recording "
                f"({number(record_s, 3)} s): hold the level longer, or do not quote τ2 and T_s there.",
            )
    for name in ("Ts", "tau1", "tau2"):
        wide = []
        for row in levels:
            ends = (row.get("ci95") or {}).get(name)
            if ends and None not in ends and row.get(name) and (ends[1] - ends[0]) / 2 > WIDE * abs(row[name]):
                wide.append(row["level"])
        if wide:
            yield Point(
                CARE,
                f"{where}{SYMBOLS[name]} is weakly known at {_listed(wide)}: its 95 % interval is wider than "
                f"±{WIDE:.0%} ({UNITS[name]}, single levels).".replace("%)", " %)", 1),
            )


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
        yield Point(GOOD, "The robust term is large enough for the inequality (15), if the bounds φ and Q_M are true.")
    elif rc.get("guaranteed") is False:
        yield Point(
            CARE,
            "Stability is not guaranteed by the inequality (15): the robust term is smaller than it asks "
            "for. The replays show how it behaves all the same.",
        )
    for text in _texts(content.get("warnings")):
        yield Point(CARE, f"Gains: {text}.".replace("..", "."))


def _listed(levels: list[float]) -> str:
    texts = [f"{level:.4g}" for level in levels]
    return f"level {texts[0]}" if len(texts) == 1 else f"levels {', '.join(texts[:-1])} and {texts[-1]}"


def _texts(warnings: Any) -> list[str]:
    if isinstance(warnings, str):
        return [line for line in warnings.splitlines() if line]
    return [str(text) for text in warnings or []]
