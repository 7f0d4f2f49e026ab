"""The choices of a fit, as one frozen type, with their tables of names."""

from dataclasses import dataclass

from eaid.errors import UsageError, unknown
from eaid.limits import check_all
from eaid.models.parameters import SHARE

MODELS = ("friction", "nonlinear", "linear")
ALLOWED: dict[str, tuple[str, ...]] = {
    "clutch": MODELS,
    "friction-force": ("friction",),
    "friction-speed": ("friction",),
}
"""Models that a kind of experiment can be fitted with."""
CONVENTIONS: dict[str, str] = {
    "zero-offset": "c0 = 0 and a0 free per level; gives the paper's range of B",
    "pooled-offset": "c0 from the pooled fit, a0 free per level",
    "pooled-dynamics": "a0 and c0 from the pooled fit, only b0 per level",
}
"""What each convention for b0 of a single level assumes, specification 4.3."""
WEIGHTS = ("equal", "sd")
LOSSES = ("squares", "huber")
SHAPES = ("auto", "one", "two", "free", "overshoot")
ESTIMATORS = ("auto", "joint", "two-stage")
INTERVALS = ("robust", "bootstrap", "profile", "white", "none")


@dataclass(frozen=True)
class FitOptions:
    """How a StepSet is fitted."""

    models: tuple[str, ...] | None = None
    """Models to fit; None: all that the kind allows."""
    share: float | None = SHARE
    """C, held; None: free."""
    weights: str = "equal"
    """equal: every sample alike. sd: each level by the spread of its repeats."""
    loss: str = "squares"
    """squares, or huber (1.345 robust standard deviations)."""
    hold_out: tuple[float, ...] = ()
    """Levels that are not fitted; the error on them is reported."""
    bounds: str = "zero-offset"
    """Convention for b0 of a single level."""
    bounds_levels: tuple[float, ...] | None = None
    """Levels over which B_m and B_M are taken; None: all that are fitted."""
    estimator: str = "auto"
    """joint: all coefficients together, as in the paper. two-stage: each level, then the polynomials through them.
    auto: the one that the evidence supports."""
    shape: str = "auto"
    """Shape of steps between levels: auto (by the evidence), one, two, free or overshoot."""
    ci: str = "robust"
    """How 95 % intervals are found: robust, bootstrap, profile, white or none."""
    seed: int = 0
    """Of the bootstrap."""
    draws: int = 300
    """Refits of the bootstrap."""
    workers: int = 1
    """Processes that share the refits; the result is the same for any number."""
    dead_time_s: float | None = None
    """Dead time of each single step [s]; None: where the evidence asks for one; 0: none."""


def check(options: FitOptions) -> None:
    """Refuse choices that are not in their tables, each in one sentence."""
    for name, value, table in (
        ("«weights»", options.weights, WEIGHTS),
        ("«loss»", options.loss, LOSSES),
        ("«bounds»", options.bounds, tuple(CONVENTIONS)),
        ("«estimator»", options.estimator, ESTIMATORS),
        ("«ci»", options.ci, INTERVALS),
        ("«shape»", options.shape, SHAPES),
    ):
        if value not in table:
            raise UsageError(unknown(name, value, table))
    check_all(seed=options.seed, dead_time=options.dead_time_s)
    if options.share is not None and not 0 < options.share < 1:
        raise UsageError(f"«share» {options.share:g}: the share of the fast part lies between 0 and 1; or say free")
