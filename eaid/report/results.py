"""What a report shows: fits, gains, replays and datasets, from files or from memory. Nothing is refitted."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, TypeVar

from eaid.errors import UsageError
from eaid.report.edge_logs import EdgeLog, edge_logs
from eaid.report.rig import of_the_paper
from eaid.results.coupling import Coupling
from eaid.results.fit import Fit
from eaid.results.gains import Gains
from eaid.results.replay import Replay
from eaid.steps.stepset import StepSet

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
        return edge_logs([run for one in self.data for run in one.result.recorded])

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
