"""The widths that a plan states: the experiment is simulated some times over, and made larger until its own intervals
keep the wanted ones.

Of n simulated widths the m-th least is kept by the next recording with probability m/(n + 1). A plan that is taken as
soon as its simulations keep the widths is taken where they came out narrow by luck: of such plans 73 recordings of a
hundred keep what 80 should. So all plans that were tried are counted, by how far each simulated width is from what its
own plan predicts.
"""

from collections.abc import Callable, Mapping, Sequence
from math import ceil, inf
from typing import Protocol, TypeVar

POWER = 0.7
"""Power of the excess by which a plan is asked for narrower: widths fall faster than their prediction."""
LEAST, MOST = 1.03, 3.0
"""Least factor by which a width that was not kept is asked for narrower, and the excess that counts at most."""
ROUNDS = 6
"""Times that a plan is made larger."""

Widths = dict[str, float]
"""Half-width of the 95 % interval at the worst input [%], by parameter; infinite where there is none."""


class Planned(Protocol):
    """An experiment that was designed."""

    @property
    def met(self) -> bool:
        """Whether its predicted widths are those wanted."""

    @property
    def half_width_pct(self) -> Mapping[str, float]:
        """Its predicted widths."""


P = TypeVar("P", bound=Planned)


def enlarged(
    make: Callable[[Mapping[str, float]], P],
    measure: Callable[[P], list[Widths]],
    wanted: Mapping[str, float],
    keeping: float,
) -> tuple[P, list[Widths]]:
    """The plan that `make` gives for the wanted widths [%], larger until each is kept with probability `keeping`.

    A width measured too wide is asked for narrower in the next round. A plan that falls short even by its prediction is
    as large as the limits allow, and stays. Returned with it are its simulated widths, and those of the plans before it
    as far from its prediction as they were from their own.
    """
    asked = dict(wanted)
    plan = make(asked)
    rows = measure(plan)
    for _ in range(ROUNDS):
        excess = over(kept_widths(rows, keeping), wanted)
        if not plan.met or max(excess.values()) <= 1:
            break
        for name, ratio in excess.items():
            if ratio > 1:
                asked[name] /= max(LEAST, min(ratio, MOST) ** POWER)
        larger = make(asked)
        if larger != plan:
            known = {name: width for name, width in plan.half_width_pct.items() if 0 < width < inf}
            scale = {name: larger.half_width_pct[name] / width for name, width in known.items()}
            # a width without end says that the smaller plan was too small, and nothing of the larger one
            ended = [row for row in rows if max(row.values()) < inf]
            before = [{name: width * scale.get(name, 1.0) for name, width in row.items()} for row in ended]
            plan, rows = larger, before + measure(larger)
    return plan, rows


def kept_widths(rows: Sequence[Widths], keeping: float) -> Widths:
    """The width that the next recording keeps with probability `keeping`, each parameter by itself."""
    place = ceil(keeping * (len(rows) + 1) - 1e-9) - 1
    return {name: sorted(row[name] for row in rows)[place] for name in rows[0]}


def over(widths: Mapping[str, float], wanted: Mapping[str, float]) -> dict[str, float]:
    """Widths over the wanted ones, of what is wanted."""
    return {name: widths[name] / width for name, width in wanted.items()}


def finite(widths: Mapping[str, float]) -> dict[str, float | None]:
    """Widths as a result holds them: None where there is no interval."""
    return {name: width if width < float("inf") else None for name, width in widths.items()}
