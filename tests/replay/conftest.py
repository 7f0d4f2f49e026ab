"""The reference plant under the published gains, in files written by hand, and replays of a signal of one's own."""

from collections.abc import Callable
from itertools import count
from typing import Any

import pytest

import eaid

from ..conftest import LINEAR, PLANT, loaded


@pytest.fixture(scope="session")
def fit_of() -> Callable[..., "eaid.Fit"]:
    """The paper's two models with some numbers of the plant changed, and other parts of fit.json."""
    return lambda plant=None, **parts: loaded({"linear": LINEAR, "nonlinear": {**PLANT, **(plant or {})}, **parts})


@pytest.fixture(scope="session")
def fit(fit_of: Callable[..., "eaid.Fit"]) -> "eaid.Fit":
    return fit_of()


@pytest.fixture(scope="session")
def gains(fit: "eaid.Fit") -> "eaid.Gains":
    return eaid.tune_rc(fit, pi_gains=(21.0, 360.0))


@pytest.fixture(scope="session")
def played(fit: "eaid.Fit", gains: "eaid.Gains", tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    """A replay of values [N·m] at intervals [s] as a reference file, or of a scenario."""
    folder, number, published = tmp_path_factory.mktemp("references"), count(), gains

    def played(wanted: Any, dt_s: float = 1e-3, *, fit: Any = fit, gains: Any = published, **options: Any) -> Any:
        if isinstance(wanted, str):
            return eaid.simulate(fit, gains, wanted, **options)
        file = folder / f"{next(number)}.csv"
        rows = (f"{k * dt_s!r},{float(value)!r}" for k, value in enumerate(wanted))
        file.write_text("\n".join(["time_s,reference_nm", *rows]))
        return eaid.simulate(fit, gains, reference=file, rate_hz=1 / dt_s, **options)

    return played


@pytest.fixture(scope="session")
def codes() -> Callable[..., dict[str, dict[str, Any]]]:
    """Findings of a replay by code, with their values."""
    return lambda run: {one.code: dict(one.values) for one in run.findings}
