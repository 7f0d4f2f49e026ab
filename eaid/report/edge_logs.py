"""Logs of closed loops, and of outputs whose input nobody knows: their edges, and what was asked for at each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eaid.logs.run import Run
from eaid.steps.edges import Edge, edges


@dataclass(frozen=True, eq=False)
class EdgeLog:
    """A log as it was recorded, and the edges of its output."""

    run: Run
    edges: tuple[Edge, ...]

    @property
    def ends_s(self) -> list[float]:
        """Where each edge gives way to the next, or the log ends [s]."""
        return [*(one.at_s for one in self.edges[1:]), float(self.run.time_s[-1])][: len(self.edges)]

    @property
    def goals(self) -> list[float | None]:
        """What the reference asks for behind each edge: its median in the second half of the edge's stretch."""
        t, wanted = self.run.time_s, self.run.reference_nm
        if wanted is None:
            return [None] * len(self.edges)
        spans = zip(self.edges, self.ends_s, strict=True)
        return [float(np.median(wanted[(t >= (one.at_s + end) / 2) & (t <= end)])) for one, end in spans]

    @property
    def rms_error(self) -> float | None:
        """Root mean square of reference − output; None without a reference."""
        wanted = self.run.reference_nm
        return None if wanted is None else float(np.sqrt(np.mean((wanted - self.run.output) ** 2)))


def is_whole(run: Run) -> bool:
    """Whether a run is a log whose edges are looked at: not cut, and a closed loop's or of an unknown input."""
    uncut = not run.cut and run.level is None and run.step_s is None
    return uncut and (run.reference_nm is not None or not run.has_input)


def edge_logs(runs: Sequence[Run]) -> tuple[EdgeLog, ...]:
    """The logs among some runs whose edges are looked at."""
    return tuple(EdgeLog(run, edges(run.time_s, run.output, run.reference_nm)) for run in runs if is_whole(run))
