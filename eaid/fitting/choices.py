"""What each choice of a fit may be (`eaid.results.fit.FitOptions`): the tables of names, and the refusal of others."""

from eaid.errors import UsageError, unknown
from eaid.limits import check_all
from eaid.results.fit import FitOptions

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
    share = options.share
    number = isinstance(share, int | float)
    if share != "free" and not (number and 0 < share < 1):
        raise UsageError(
            f"«share» {f'{share:g}' if number else share}: the share of the fast part lies between 0 and 1; or say free"
        )
