"""`eaid tune-rc --optimize`: what the search needs from the user's files, and what it told."""

from typing import TYPE_CHECKING, Any

from eaid.cli import console
from eaid.errors import DataError, UsageError

if TYPE_CHECKING:
    from eaid.control.options import DesignOptions
    from eaid.replay.references import Reference
    from eaid.steps.stepset import StepSet

USUAL_NOISE_NM = 0.01
"""Torque noise where no log tells it [N·m]."""


def noise_of(fitted: dict[str, Any], stepset: "StepSet | None") -> tuple[float, str]:
    """Torque noise for the search [N·m], and where it comes from."""
    from eaid.control.noise import white_noise_nm

    if stepset is not None and stepset.output_unit in ("N·m", "Nm"):
        return white_noise_nm(stepset), "white part of what the logs show"
    # The fit keeps a density of the noise at low frequency: an upper bound of what white noise alone would have.
    density = ((fitted.get("uncertainty") or {}).get("noise") or {}).get("sensor_nm2_s")
    rate = (fitted.get("data") or {}).get("sample_rate_hz")
    if density and rate:
        return float((density * rate) ** 0.5), "as the fit tells it"
    console.warn(
        f"no logs to take the torque noise from: {USUAL_NOISE_NM:g} N·m is supposed; give --noise-nm or --data"
    )
    return USUAL_NOISE_NM, "supposed"


def search_of(noise_nm: float, limit: float | None, also: str | None, evaluations: int, seed: int) -> Any:
    """The search that the options ask for; UsageError where one of them makes no sense."""
    from eaid.replay.optimize import ALSO, Search

    chosen = tuple(name.strip() for name in (also or "").split(",") if name.strip())
    for name in chosen:
        if name not in ALSO:
            raise UsageError(f"--optimize-also {name}: must be of {', '.join(ALSO)}")
    if noise_nm < 0:
        raise UsageError(f"--noise-nm {noise_nm:g}: must be 0 or above")
    if limit is not None and not limit > 0:
        raise UsageError(f"--chatter-limit {limit:g}: must be above 0")
    if evaluations < 1:
        raise UsageError(f"--evaluations {evaluations}: must be 1 or more")
    return Search(noise_nm=noise_nm, limit_pct=limit, also=chosen, evaluations=evaluations, seed=seed)


def optimized(
    fitted: dict[str, Any], options: "DesignOptions", source: str, wanted: "Reference | None", search: Any, plants: int
) -> "tuple[DesignOptions, dict[str, Any]]":
    """The options that the search ends at, and what it traded."""
    from eaid.control.bounds import bounds_of, model_of
    from eaid.control.design import plant_of
    from eaid.control.operating import operating_points
    from eaid.replay.optimize import optimize as search_for
    from eaid.replay.references import multisine
    from eaid.uncertainty.draw import covariance_word, draw_plants

    if plants < 1:
        raise UsageError(f"--plants {plants}: must be 1 or more")
    plant = plant_of(fitted)
    if plant is None:
        raise DataError(f"{source}: holds no nonlinear model, which --optimize replays on; fit clutch data with it")
    word = covariance_word(fitted)
    drawn = [plant] if word else draw_plants(fitted, plants, search.seed)
    model = model_of(fitted, source)
    bounds = bounds_of(fitted, source, options.convention, options.levels, options.widen)
    reference = wanted if wanted is not None else multisine(1 / options.timing.rate_hz)
    points = operating_points(fitted, model, plant, bounds)
    with console.progress("candidates", search.candidates) as tick:
        found = search_for(model, bounds, options, drawn, points, reference, search, tick)
    told = {
        "plants": len(drawn), "noise_nm": search.noise_nm, "also": list(search.also), "limit_pct": found.limit_pct,
        "before": found.start.as_dict(), "after": found.best.as_dict(),
        "warnings": [f"--optimize: {word}"] if word else [],
    }  # fmt: skip
    return found.best.law.options, told
