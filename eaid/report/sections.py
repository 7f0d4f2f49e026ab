"""What stands where on the page: sections with their tables, the files, the commands, the words."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from eaid.report import tables
from eaid.report.available import two_alike
from eaid.report.comparison import compare
from eaid.report.details import details, guarantee, margins, runs
from eaid.report.replay_tables import log_table, plants_table, rehab_tables, replay_table, step_tables
from eaid.report.results import Fit, Results
from eaid.report.style import controller_name
from eaid.report.tables import KINDS, Table


@dataclass(frozen=True)
class Section:
    """A section: its figures stand between the tables of `first` and those of `tables`."""

    id: str
    title: str
    lead: str
    first: tuple[Table, ...]
    tables: tuple[Table, ...]


def title(results: Results, synthetic: str | None) -> str:
    """What the page is about; synthetic data say so."""
    if two_alike(results):
        text = "Electroadhesive clutch: two fits side by side"
    elif results.fits:
        kinds = list(dict.fromkeys(KINDS.get(fit.kind, (fit.kind, ""))[0] for fit in results.fits))
        text = f"Electroadhesive clutch: report on {', '.join(kinds)}"
    elif results.replays:
        text = "Electroadhesive clutch: replays"
    else:
        text = "Electroadhesive clutch: report"
    return f"{text} (synthetic data)" if synthetic else text


def inputs(results: Results) -> Table:
    """The files given to the report and, for each fit, the files behind it."""
    rows: list[tuple[str, ...]] = [
        (source.path, source.kind, _what(results, source.path), source.sha256) for source in results.sources
    ]
    given = {source.sha256 for source in results.sources}
    for fit in results.fits:
        data = fit.content.get("data") or {}
        named = [item for item in data.get("inputs") or [] if isinstance(item, Mapping)]
        behind = named or [item for item in data.get("sources") or [] if isinstance(item, Mapping)]
        runs: dict[tuple[str, str], Counter[Any]] = {}
        for item in behind:
            runs.setdefault((str(item.get("path", "?")), str(item.get("sha256", "–"))), Counter())[
                item.get("level")
            ] += 1
        for (path, sha), counts in runs.items():
            if sha not in given:
                rows.append((path, f"log behind {fit.source.path}", "–" if named else _levels(counts), sha))
    return Table(
        "Files",
        "What was given to this report, and the logs that the fits name. The fingerprint (SHA-256) tells one "
        "version of a file from another.",
        ("file", "what it is", "holds", "fingerprint"),
        tuple(rows),
        formulas=False,
    )


def _levels(counts: Counter[Any]) -> str:
    if not counts:
        return "–"
    least, most = min(counts.values()), max(counts.values())
    runs = f"{least}" if least == most else f"{least} to {most}"
    return f"{len(counts)} level{'s' if len(counts) != 1 else ''}, {runs} run{'s' if most != 1 else ''} each"


def _what(results: Results, path: str) -> str:
    for fit in results.fits:
        if fit.source.path == path:
            data = fit.content.get("data") or {}
            models = [name for name in ("friction", "nonlinear", "linear", "release") if fit.content.get(name)]
            text = f"{KINDS.get(fit.kind, (fit.kind, ''))[0]}: {', '.join(models) or 'no model'}"
            counts = Counter(
                item.get("level")
                for item in data.get("sources") or []
                if isinstance(item, Mapping) and item.get("edge") != "falling"
            )
            return f"{text}; {_levels(counts)}" if counts else text
    for data in results.data:
        if data.source.path == path:
            counts = Counter(level.level for level in data.steps.levels for _ in level.names)
            return f"{KINDS.get(data.steps.kind, (data.steps.kind, ''))[0]}: {_levels(counts)}"
    for replay in results.replays:
        if replay.source.path == path:
            names = [controller_name(name) for name in replay.traces]
            many = ", ".join(names) if len(names) < 6 else f"{len(names)} runs"
            return f"{replay.scenario or 'replay'}: {many}"
    return "robust and PI gains"


def sections(results: Results) -> list[Section]:
    """The sections that have anything to show, in the order of the page."""
    found = []
    pair = two_alike(results)
    if pair:
        found.append(
            Section(
                "compare",
                "Side by side",
                "The same values of both fits; a difference beyond both intervals is more than repeats explain.",
                (compare(*pair),),
                (),
            )
        )
    if results.data or results.fit("clutch"):
        found.append(
            Section(
                "data",
                "Data",
                "What was recorded: each run, its repeats, and what is doubtful in it.",
                (),
                tuple(runs(data) for data in results.data),
            )
        )
    if results.fits:
        found.append(
            Section(
                "models",
                "Models",
                "What was fitted to the data, with 95 % intervals where the fit gives them, beside the "
                "published values.",
                _published_tables(results),
                tuple(t for fit in results.fits for t in details(fit, called(results, fit))),
            )
        )
    if results.gains or (results.fit("clutch") and (results.fit("clutch") or results.fits[0]).content.get("linear")):
        gains = [
            t
            for one in results.gains
            for t in (
                tables.table_iv(one.content),
                tables.gains_table(one.content),
                *guarantee(one.content),
                *margins(one.content),
            )
        ]
        found.append(
            Section(
                "gains",
                "Gains",
                "What the two controllers use, and whether the robust one's stability condition, inequality "
                "(15), holds.",
                tuple(gains),
                (),
            )
        )
    if replays := [replay for replay in results.replays if replay.scenario != "rehab"]:
        found.append(
            Section(
                "replays",
                "Replays",
                "Controllers tried on the fitted plant: no rig was moved.",
                tuple(log_table(replay) if replay.scenario == "log" else replay_table(replay) for replay in replays),
                tuple(t for replay in replays for t in (*plants_table(replay), *step_tables(replay))),
            )
        )
    if (rehab := results.replay("rehab")) is not None:
        found.append(
            Section(
                "rehab",
                "Rehabilitation",
                "A simulated elbow in three exercises on the fitted clutch: resisted softly, resisted hard, "
                "and moved by the device.",
                (),
                tuple(rehab_tables(rehab)),
            )
        )
    return found


def called(results: Results, fit: Fit) -> str:
    """What a fit is called in headings: its kind, and its file where there are several of that kind."""
    kind = KINDS.get(fit.kind, (fit.kind, ""))[0]
    several = sum(1 for other in results.fits if other.kind == fit.kind) > 1
    return f"{kind}, {fit.source.path}" if several else kind


def _published_tables(results: Results) -> tuple[Table, ...]:
    found = []
    if (fit := results.fit("friction-force")) and fit.content.get("friction"):
        found.append(tables.table_i(fit.content))
    if (fit := results.fit("friction-speed")) and fit.content.get("friction"):
        found.append(tables.table_ii(fit.content))
    if (fit := results.fit("clutch")) and fit.content.get("nonlinear"):
        found.append(tables.table_iii(fit.content))
    if (fit := results.fit("clutch")) and fit.content.get("linear"):
        found.append(tables.linear_table(fit.content))
    return tuple(found)
