"""What a report shows: fits, gains, replays and datasets, from files or from memory. Nothing is refitted."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Generic, TypeVar

import h5py
import numpy as np

from eaid.apparatus import Apparatus
from eaid.arrays import Array, read_only
from eaid.errors import DataError, UsageError
from eaid.files import sha256_of
from eaid.findings import Finding, say
from eaid.logs.hdf import open_hdf5
from eaid.logs.read import read_runs
from eaid.logs.run import Run
from eaid.options import ReadOptions
from eaid.replay import files as replay_files
from eaid.replay.controllers import CONTROLLERS
from eaid.report.rig import of_the_paper
from eaid.results import codec
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay
from eaid.steps.build import build_stepset
from eaid.steps.edges import Edge, edges
from eaid.steps.stepset import StepSet

EdgeLog = tuple[Run, tuple[Edge, ...]]
"""A log as it was recorded, and the edges of its output."""


def is_whole(run: Run) -> bool:
    """Whether a run is a log whose edges are looked at: not cut, and a closed loop's or of an unknown input."""
    uncut = not run.cut and run.level is None and run.step_s is None
    return uncut and (run.reference_nm is not None or not run.has_input)


SCENARIOS = ("steps", "multisine", "sweep", "ramp", "reference", "log", "rehab")
"""The order of the paper, and of the page."""
NEEDED = ("time_s", "reference_nm", "torque_nm", "duty_pct")
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Given(Generic[T]):
    """A result and where it comes from."""

    result: T
    path: str
    """What the result is called: its file, as given."""
    sha256: str = ""


@dataclass(frozen=True, eq=False)
class Results:
    """All that a page shows, in the order in which it was given."""

    fits: tuple[Given[Fit], ...] = ()
    gains: tuple[Given[Gains], ...] = ()
    replays: tuple[Given[Replay], ...] = ()
    data: tuple[Given[StepSet], ...] = ()
    couplings: tuple[Given[Coupling], ...] = ()
    paper: bool | None = None
    """Whether published values stand beside these; None where the units are those of the paper's rig."""

    @property
    def main_kind(self) -> str | None:
        """The kind that the page is about: the clutch where there is one."""
        return next(iter(self.kinds), None)

    @property
    def main(self) -> "Results":
        """The same without fits and data of other kinds."""
        kind = self.main_kind
        fits = tuple(one for one in self.fits if one.result.data.kind == kind)
        return replace(self, fits=fits, data=tuple(one for one in self.data if one.result.kind == kind))

    @property
    def main_fit(self) -> Fit | None:
        """The first fit of that kind."""
        return self.fit(self.main_kind or "")

    @property
    def main_data(self) -> StepSet | None:
        """The first dataset of that kind that holds steps from rest."""
        return self.data_of(self.main_kind or "")

    @property
    def every(self) -> tuple[Given[Any], ...]:
        """All results, whatever their kind."""
        return (*self.data, *self.fits, *self.gains, *self.replays, *self.couplings)

    @property
    def of_paper(self) -> bool:
        """Whether the page's own kind was recorded as the paper's was."""
        about = self.main_fit.data if self.main_fit is not None else self.main_data
        return self.main_kind is None or of_the_paper(about, self.paper)

    def fit(self, kind: str) -> Fit | None:
        """The first fit of a kind."""
        return next((one.result for one in self.fits if one.result.data.kind == kind), None)

    def data_of(self, kind: str) -> StepSet | None:
        """The first dataset of a kind that holds steps from rest, which is what figures of levels show."""
        return next((one.result for one in self.data if one.result.kind == kind and one.result.levels), None)

    def replay(self, scenario: str) -> Replay | None:
        """The first replay of a scenario."""
        return next((one.result for one in self.replays if one.result.head.scenario == scenario), None)

    @cached_property
    def edge_logs(self) -> tuple[EdgeLog, ...]:
        """The logs of the datasets whose edges are looked at, as of closed loops."""
        runs = [run for one in self.data for run in one.result.recorded if is_whole(run)]
        return tuple((run, edges(run.time_s, run.output, run.reference_nm)) for run in runs)

    @property
    def shows_edges(self) -> bool:
        """Whether the page is about edges of outputs: logs of closed loops, and no fit and no steps beside them."""
        return bool(self.edge_logs) and not self.fits and not any(one.result.levels for one in self.data)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of experiment that fits or datasets show, the clutch first."""
        found = {one.result.data.kind for one in self.fits} | {one.result.kind for one in self.data}
        return tuple(kind for kind in KINDS if kind in found)

    @property
    def pair(self) -> tuple[Given[Fit], Given[Fit]] | None:
        """The first two fits of one kind: those that are put side by side."""
        for i, first in enumerate(self.fits):
            for second in self.fits[i + 1 :]:
                if first.result.data.kind == second.result.data.kind:
                    return first, second
        return None

    @property
    def synthetic(self) -> str | None:
        """What made the data, where any of them are not recorded; None where all come from a rig."""
        said = [one.result.data.synthetic for one in self.fits] + [one.result.synthetic for one in self.data]
        said += [one.result.head.synthetic for one in self.replays]
        return next((str(one) for one in said if one), None)


KINDS = {"clutch": "clutch", "friction-force": "friction over force", "friction-speed": "friction over speed"}
"""Kind of experiment → how it is called."""


def gathered(items: Iterable["Fit | Gains | Replay | StepSet | Coupling | Given[Any]"]) -> Results:
    """Results in memory as a report takes them: each gets a name by its kind, replays the order of the paper."""
    kinds: dict[str, type] = {"fit": Fit, "gains": Gains, "replay": Replay, "data": StepSet, "couple": Coupling}
    sorted_: dict[str, list[Given[Any]]] = {kind: [] for kind in kinds}
    for item in items:
        result = item.result if isinstance(item, Given) else item
        kind = next((name for name, type_ in kinds.items() if isinstance(result, type_)), None)
        if kind is None:
            raise UsageError(f"a {type(result).__name__} is no result that a report can show")
        count = len(sorted_[kind])
        name = f"{kind} {count + 1}" if count else kind
        sorted_[kind].append(item if isinstance(item, Given) else Given(result, name))
    order = {name: i for i, name in enumerate(SCENARIOS)}
    sorted_["replay"].sort(key=lambda one: order.get(one.result.head.scenario, len(order)))
    fits, gains, replays, data, couplings = (tuple(group) for group in sorted_.values())
    return Results(fits, gains, replays, data, couplings)


def read_results(paths: Sequence[Path], tell: Callable[[str], None] = lambda _: None) -> Results:
    """Read and sort any number of result files; all that cannot be read are told at once.

    `tell` gets a sentence for each part of a file that is left out.
    """
    items: list[Given[Any]] = []
    faults: list[str] = []
    for path in paths:
        try:
            kind = kind_of(path)
            result, found = _READERS[kind](path)
            items.append(Given(result, str(path), sha256_of(path)))
            for one in found:
                tell(say(one))
        except DataError as fault:
            faults.extend(fault.sentences)
    if faults:
        raise DataError(*faults)
    return gathered(items)


def kind_of(path: Path) -> str:
    """fit, gains, replay, data or couple, by what the file says of itself; anything else is refused."""
    if path.is_dir():
        raise UsageError(f"{path}: is a folder; give the files in it that eaid wrote")
    if not path.is_file():
        raise DataError(f"{path}: no such file; give a fit.json, gains.json, replay.h5 or data.h5 that eaid wrote")
    if h5py.is_hdf5(path):
        with open_hdf5(path, str(path)) as file:
            said = file.attrs.get("schema")
            schema = str(said if said is not None else "eaid/data/1" if "runs" in file else "")
    else:
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
        except (ValueError, RecursionError):  # no UTF-8, no JSON, or numbers and nesting beyond all reason
            content = None
        schema = str(content.get("schema", _by_its_parts(content))) if isinstance(content, dict) else ""
    known = {codec.schema_of(kind): kind for kind in ("fit", "gains", "replay", "data", "couple")}
    if schema not in known:
        codec.refuse_other_version(path, schema)
        raise DataError(f"{path}: is no result of eaid; give a fit.json, gains.json, replay.h5 or data.h5")
    return known[schema]


def _by_its_parts(content: Mapping[str, object]) -> str:
    """The schema of a file of the user's own script that names none."""
    return next(
        (codec.schema_of(kind) for kind, parts in codec.KINDS.items() if any(part in content for part in parts)), ""
    )


MOST = 400_000
"""Samples of a run from which on blocks of it are averaged: the page draws a hundredth of them."""
MOST_OF_ALL = 5_000_000
"""The same for all runs of a dataset, several of which a report may hold."""
LEAST = 4_000
"""Samples that each run keeps where there are thousands of runs."""
PIECE = 1 << 20


def shortened(run: Run, runs: int = 1) -> tuple[Run, int]:
    """A run, one of so many, of at most about `MOST` samples, and how many samples each of its values is the mean of.

    Blocks begin at the step, so that none holds samples from before and after it; of the input each block keeps its
    first value.
    """
    every = -(-len(run.time_s) // min(MOST, max(LEAST, MOST_OF_ALL // runs)))
    if every == 1 or run.step_s is None:
        return run, 1
    offset = int(np.searchsorted(run.time_s, run.step_s)) % every
    time, output = (_means(values, offset, every) for values in (run.time_s, run.output))
    first = read_only(np.array(run.input[offset::every][: len(time)]))
    return replace(run, time_s=time, input=first, output=output, reference_nm=None), every


def _means(values: Array, offset: int, every: int) -> Array:
    count = (len(values) - offset) // every
    found = np.empty(count)
    step = max(PIECE // every, 1)
    for at in range(0, count, step):
        some = np.asarray(values[offset + at * every : offset + min(at + step, count) * every])
        found[at : at + step] = some.reshape(-1, every).mean(axis=1)
    return read_only(found)


def as_recorded(data: StepSet, every: dict[str, int]) -> StepSet:
    """The step set with the samples and rates that were recorded."""
    rows = [(run, every.get(run.name, 1)) for run in data.runs]
    return replace(data, runs=tuple(replace(r, samples=r.samples * k, rate_hz=r.rate_hz * k) for r, k in rows))


def _read_data(path: Path) -> tuple[StepSet, tuple[Finding, ...]]:
    every: dict[str, int] = {}
    with open_hdf5(path, str(path)) as file:
        count = max(1, len(file.get("runs", ())))

    def short(run: Run) -> Run:
        run, every[run.name] = shortened(run, count)
        return run

    runs = read_runs([path], each=short)
    whole = tuple(run for run in runs if is_whole(run))
    if len(whole) < len(runs):
        steps = as_recorded(build_stepset([run for run in runs if not is_whole(run)], ReadOptions()), every)
        return replace(steps, recorded=whole), ()
    first = whole[0]
    rig = first.apparatus or Apparatus()
    return StepSet(
        first.kind or "clutch", first.input_unit, first.output_unit, rig, (), recorded=whole, synthetic=first.synthetic
    ), ()


def _read_replay(path: Path) -> tuple[Replay, tuple[Finding, ...]]:
    """A replay.h5 whose groups can be drawn; one without its columns, or with a time that does not rise, is refused."""
    replay, found = replay_files.read(path)
    drawn = {name: one for name, one in replay.records.items() if set(NEEDED) & set(one.columns) != {"time_s"}}
    faults = []
    for name, one in drawn.items():
        t = one.columns["time_s"]
        if missing := [key for key in NEEDED if key not in one.columns]:
            faults.append(f"{path}: controller {name!r} has no {', '.join(missing)}; make the replay again")
        elif not (t[1:] > t[:-1]).all():
            faults.append(f"{path}: {name}: its time_s does not rise from sample to sample; make the replay again")
    if faults:
        raise DataError(*faults)
    if not drawn:
        raise DataError(f"{path}: holds no controller; make it again with eaid simulate")
    known = {name: i for i, name in enumerate(CONTROLLERS)}
    ordered = dict(sorted(drawn.items(), key=lambda item: known.get(item[0], len(known))))
    return replace(replay, records=ordered), found


_READERS: Mapping[str, Callable[[Path], tuple[Any, tuple[Finding, ...]]]] = {
    "fit": partial(codec.read, kind="fit", type_=Fit),
    "gains": partial(codec.read, kind="gains", type_=Gains),
    "couple": partial(codec.read, kind="couple", type_=Coupling),
    "replay": _read_replay,
    "data": _read_data,
}
