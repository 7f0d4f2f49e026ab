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
LOSSES = ("squares", "huber")
SHAPES = ("auto", "one", "two", "free", "overshoot")
ESTIMATORS = ("auto", "joint", "two-stage")
INTERVALS = ("robust", "bootstrap", "white", "none")


def check(options: FitOptions) -> None:
    """Refuse choices that are not in their tables, each in one sentence."""
    for name, value, table in (
        ("«loss»", options.loss, LOSSES),
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
