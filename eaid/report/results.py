"""Files of the contract (fit.json, gains.json, replay.h5, data.h5) → what the report shows. Nothing is refitted."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py

from eaid.arrays import Array
from eaid.errors import DataError, UsageError
from eaid.files import sha256_of
from eaid.logs.hdf import open_hdf5
from eaid.logs.options import ReadOptions
from eaid.logs.read import read_runs
from eaid.logs.run import Run
from eaid.logs.walk import root_of
from eaid.replay import files as replay_files
from eaid.replay.controllers import CONTROLLERS
from eaid.steps.build import StepOptions, build_stepset
from eaid.steps.stepset import StepSet
from eaid.store import PARTS, read_json

SCENARIOS = ("steps", "multisine", "sweep", "reference", "log", "rehab")
"""The order of the paper, and of the page."""


@dataclass(frozen=True)
class Source:
    """One file that was given to the report."""

    path: str
    sha256: str
    kind: str
    """fit, gains, replay or data."""


@dataclass(frozen=True)
class Fit:
    """One fit.json."""

    source: Source
    content: Mapping[str, Any]

    @property
    def kind(self) -> str:
        """clutch, friction-force or friction-speed."""
        return str((self.content.get("data") or {}).get("kind", "clutch"))


@dataclass(frozen=True)
class Gains:
    """One gains.json."""

    source: Source
    content: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Replay:
    """One replay.h5."""

    source: Source
    scenario: str
    options: Mapping[str, Any]
    traces: Mapping[str, Mapping[str, Array]]
    """Controller → column → values; every column has the controller's own length."""
    summary: Mapping[str, Any] = field(default_factory=dict)
    """Controller → its numbers, where the file holds them."""
    tables: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """Controller → further arrays by name, as the band over drawn plants."""


@dataclass(frozen=True, eq=False)
class Data:
    """One data.h5: its runs as recorded, and its averaged steps."""

    source: Source
    runs: tuple[Run, ...]
    steps: StepSet


@dataclass(frozen=True, eq=False)
class Results:
    """All that a page shows, in the order in which it was given."""

    fits: tuple[Fit, ...] = ()
    gains: tuple[Gains, ...] = ()
    replays: tuple[Replay, ...] = ()
    data: tuple[Data, ...] = ()

    @property
    def sources(self) -> tuple[Source, ...]:
        """Every file that was given."""
        parts: tuple[Sequence[Any], ...] = (self.data, self.fits, self.gains, self.replays)
        return tuple(part.source for group in parts for part in group)

    def fit(self, kind: str) -> Fit | None:
        """The first fit of a kind."""
        return next((fit for fit in self.fits if fit.kind == kind), None)

    def data_of(self, kind: str) -> Data | None:
        """The first dataset of a kind."""
        return next((data for data in self.data if data.steps.kind == kind), None)

    def replay(self, scenario: str) -> Replay | None:
        """The first replay of a scenario."""
        return next((replay for replay in self.replays if replay.scenario == scenario), None)


def read_results(paths: Sequence[Path], tell: Callable[[str], None] = lambda _: None) -> Results:
    """Read and sort any number of result files; all that cannot be read are told at once.

    `tell` gets a sentence for each part of a file that is left out.
    """
    fits: list[Fit] = []
    gains: list[Gains] = []
    replays: list[Replay] = []
    data: list[Data] = []
    faults: list[str] = []
    for path in paths:
        try:
            kind = kind_of(path)
            source = Source(str(path), sha256_of(path), kind)
            if kind == "fit":
                fits.append(Fit(source, _with_whole_curves(read_json(path, "fit", tell))))
            elif kind == "gains":
                gains.append(Gains(source, read_json(path, "gains", tell)))
            elif kind == "replay":
                replays.append(read_replay(path, source, tell))
            else:
                data.append(read_data(path, source))
        except DataError as fault:
            faults.extend(fault.sentences)
    if faults:
        raise DataError(*faults)
    replays.sort(key=lambda one: SCENARIOS.index(one.scenario) if one.scenario in SCENARIOS else len(SCENARIOS))
    return Results(tuple(fits), tuple(gains), tuple(replays), tuple(data))


def _with_whole_curves(content: dict[str, Any]) -> dict[str, Any]:
    """A fit.json without the friction levels that hold no curve to draw."""
    part = content.get("friction") or {}
    if part.get("levels"):
        kept = [row for row in part["levels"] if all(row.get(key) is not None for key in ("Ts", "tau1", "tau2"))]
        content["friction"] = {**part, "levels": kept}
    return content


def kind_of(path: Path) -> str:
    """fit, gains, replay or data, by what the file says of itself; anything else is refused."""
    if path.is_dir():
        raise UsageError(f"{path}: is a folder; give the files in it that eaid wrote")
    if not path.is_file():
        raise DataError(f"{path}: no such file; give a fit.json, gains.json, replay.h5 or data.h5 that eaid wrote")
    if h5py.is_hdf5(path):
        with open_hdf5(path, str(path)) as file:
            said = root_of(file).fact("schema")
            schema = str(said if said is not None else "eaid/data/1" if "runs" in file else "")
    else:
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except (ValueError, RecursionError):  # no UTF-8, no JSON, or numbers and nesting beyond all reason
            content = None
        schema = str(content.get("schema", _by_its_parts(content))) if isinstance(content, dict) else ""
    known = {"eaid/fit/1": "fit", "eaid/gains/1": "gains", "eaid/replay/1": "replay", "eaid/data/1": "data"}
    if schema not in known:
        raise DataError(f"{path}: is no result of eaid; give a fit.json, gains.json, replay.h5 or data.h5")
    return known[schema]


def _by_its_parts(content: dict[str, Any]) -> str:
    """The schema of a file of the user's own script that names none."""
    return next((f"eaid/{kind}/1" for kind, parts in PARTS.items() if any(part in content for part in parts)), "")


def read_replay(path: Path, source: Source, tell: Callable[[str], None] = lambda _: None) -> Replay:
    """Traces, options and measured numbers of a replay.h5; a controller without its four columns is refused."""
    records, options = replay_files.read_replay(path, tell)
    needed = ("time_s", "reference_nm", "torque_nm", "duty_pct")
    traces = {
        name: record.columns for name, record in records.items() if set(needed) & set(record.columns) != {"time_s"}
    }
    missing = {name: [key for key in needed if key not in columns] for name, columns in traces.items()}
    faults = [
        f"{path}: controller {name!r} has no {', '.join(keys)}; make the replay again"
        for name, keys in missing.items()
        if keys
    ]
    faults += [
        f"{path}: {name}: its time_s does not rise from sample to sample; make the replay again"
        for name, columns in traces.items()
        if not (columns["time_s"][1:] > columns["time_s"][:-1]).all()
    ]
    faults += [f"{path}: {name}: {fault}" for name in traces if (fault := _band_fault(records[name].tables, options))]
    if faults:
        raise DataError(*faults)
    if not traces:
        raise DataError(f"{path}: holds no controller; make it again with eaid simulate")
    known = list(CONTROLLERS)
    traces = dict(sorted(traces.items(), key=lambda item: known.index(item[0]) if item[0] in known else len(known)))
    summary = {name: records[name].metrics for name in traces}
    more = {name: records[name].tables for name in traces}
    return Replay(source, str(options.get("scenario", "")), options, traces, summary, more)


def _band_fault(tables: Mapping[str, Array], options: Mapping[str, Any]) -> str | None:
    """What is wrong with the torques of drawn plants: they have a row a quantile and a column an instant."""
    if "plants/band_nm" not in tables:
        return None
    band, time = tables["plants/band_nm"], tables.get("plants/band_time_s")
    wanted = None if time is None else (len(options.get("band_quantiles") or []), *time.shape)
    if band.shape == wanted and all(part.dtype.kind in "fiu" for part in (band, time) if part is not None):
        return None
    return "its plants/band_nm has not a number for every quantile and instant; make the replay again"


def read_data(path: Path, source: Source) -> Data:
    """Runs of a data.h5 and their averaged steps."""
    runs = tuple(read_runs([path], ReadOptions()))
    return Data(source, runs, build_stepset(runs, StepOptions()))


def synthetic_of(results: Results) -> str | None:
    """What made the data, where any of them are not recorded; None where all come from a rig."""
    for fit in results.fits:
        if said := (fit.content.get("data") or {}).get("synthetic"):
            return str(said)
    for data in results.data:
        if data.steps.synthetic:
            return data.steps.synthetic
    for replay in results.replays:
        if said := replay.options.get("synthetic"):
            return str(said)
    return None
