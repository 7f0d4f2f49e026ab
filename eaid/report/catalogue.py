"""Every figure of the page: its name, its part of the page, what it needs, who makes that, and who draws it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from eaid.report.figures import checks, clutch, coupling, recorded, rehab, replays, steps, values
from eaid.report.results import Results
from eaid.report.style import Ready

Need = Callable[[Results], Any]


@dataclass(frozen=True)
class Row:
    """One figure of the catalogue."""

    name: str
    """File name without ending."""
    title: str
    needs: tuple[Need, ...]
    """What is given to `show`, in this order; the figure is left out where one of them is None."""
    show: Callable[..., Ready | None]
    made_by: str = ""
    """The command that makes what is missing; empty where its absence is no loss."""
    of_the_fit: bool = True
    """Whether it shows the fit of the clutch, or what was made from it; a mark of that fit goes on it then."""

    def ready(self, results: Results) -> Ready | None:
        """The figure, or None where its data were not given."""
        given = [need(results) for need in self.needs]
        found = None if any(one is None for one in given) else self.show(*given)
        title = self.title if results.of_paper else self.title.split(" · ")[-1]
        return found and replace(found, title=found.title or title)


def _fit(kind: str) -> Need:
    return lambda results: results.fit(kind)


def _data(kind: str) -> Need:
    return lambda results: results.data_of(kind)


def _replay(scenario: str) -> Need:
    return lambda results: results.replay(scenario)


def _recorded(results: Results) -> Any:
    return next((one.result for one in results.fits if one.result.recorded is not None), None)


def _all(results: Results) -> Results:
    return results


_CLUTCH, _ON_CLUTCH = _fit("clutch"), (_data("clutch"), _fit("clutch"))
_ON_FORCE = (_data("friction-force"), _fit("friction-force"))
_ON_SPEED = (_data("friction-speed"), _fit("friction-speed"))
_MADE = {
    "clutch": "eaid fit clutch.h5 -o fit.json",
    "force": "eaid fit friction-force.h5 -o friction-force.json",
    "speed": "eaid fit friction-speed.h5 -o friction-speed.json",
    "held": "eaid ingest LOGS (with the release recorded) -o data.h5",
    "log": "eaid simulate fit.json --log LOG -o log.h5",
}


def _replayed(scenario: str) -> str:
    return f"eaid simulate fit.json --gains gains.json --scenario {scenario} -o {scenario}.h5"


FIGURES: tuple[Row, ...] = (
    Row("compare", "Two fits over each other", (lambda results: results.pair,), values.two_fits_ready),
    Row("fig02_pwm", "Fig. 2 · One PWM period", (_all,), clutch.pwm_ready, of_the_fit=False),
    Row("edges", "Edges of the output", (lambda results: results.edge_logs,), recorded.edges_ready, of_the_fit=False),
    Row("fig06_hold_and_release", "Fig. 6 · Output while held and after release",
        (lambda results: results.main_data,), clutch.hold_ready, _MADE["held"], of_the_fit=False),
    Row("recorded_logs", "Logs as recorded", (_recorded,), recorded.logs_ready),
    Row("fig07_nonlinear_model", "Fig. 7 · Nonlinear model", (_data("clutch"), _all), clutch.nonlinear_ready,
        "eaid ingest LOGS -o clutch.h5"),
    Row("model_over_duty", "Parameters over the level", (_CLUTCH, _all), values.polynomials_ready, _MADE["clutch"]),
    Row("residuals_nonlinear", "What the nonlinear model leaves", _ON_CLUTCH,
        partial(checks.residuals_ready, "nonlinear", True), _MADE["clutch"]),
    Row("bode", "Frequency response", (_recorded,), recorded.bode_ready),
    Row("level_steps", "Steps from level to level", (_all,), steps.level_steps_ready, of_the_fit=False),
    Row("steps_over_level", "Gain and time constants of steps", (_all,), steps.over_level_ready,
        of_the_fit=False),
    Row("fig08_linear_model", "Fig. 8 · Linear model", _ON_CLUTCH, clutch.linear_ready, _MADE["clutch"]),
    Row("residuals_linear", "What the linear model leaves", _ON_CLUTCH,
        partial(checks.residuals_ready, "linear", False), _MADE["clutch"]),
    Row("fig09_shear_per_field", "Fig. 9 · Shear stress over the electric field", (_CLUTCH, _all),
        clutch.shear_ready),
    Row("fig03_friction_steps", "Fig. 3 · Friction steps", (_all,), clutch.friction_steps_ready,
        "eaid ingest LOGS -o friction.h5", of_the_fit=False),
    Row("fig04_friction_over_stress", "Fig. 4 · Friction over the normal stress", (_fit("friction-force"), _all),
        partial(clutch.trends_ready, clutch.friction_over_stress), _MADE["force"], of_the_fit=False),
    Row("residuals_friction_force", "What the friction curves leave, over force", _ON_FORCE,
        partial(checks.residuals_ready, "friction", True), _MADE["force"], of_the_fit=False),
    Row("fig05_friction_over_speed", "Fig. 5 · Friction over the rotation speed", (_fit("friction-speed"), _all),
        partial(clutch.trends_ready, clutch.friction_over_speed), _MADE["speed"], of_the_fit=False),
    Row("residuals_friction_speed", "What the friction curves leave, over speed", _ON_SPEED,
        partial(checks.residuals_ready, "friction", False), _MADE["speed"], of_the_fit=False),
    Row("input_gain", "Input gain of each level", (_CLUTCH, _all), clutch.input_gain_ready, _MADE["clutch"]),
    Row("fig12_multisine", "Fig. 12 · Sum of sines", (_replay("multisine"),), replays.tracking_ready,
        _replayed("multisine")),
    Row("own_reference", "Your own reference", (_replay("reference"),), replays.tracking_ready),
    Row("fig11_steps", "Fig. 11 · Steps", (_replay("steps"),), replays.tracking_ready, _replayed("steps")),
    Row("fig13_sweep", "Fig. 13 · Sines of rising frequency", (_replay("sweep"),), replays.sweep_ready,
        _replayed("sweep")),
    Row("guarantee_in_replay", "What the robust term has to cover", (lambda results: results.replays,),
        replays.guarantee_ready, _replayed("multisine")),
    Row("walls", "How stiff a virtual wall may be", (lambda results: results.couplings,), coupling.walls_ready),
    Row("log_replay", "Recorded input through the model", (_replay("log"),), replays.log_ready, _MADE["log"]),
    Row("fig16_rehab", "Fig. 16 · Elbow rehabilitation", (_replay("rehab"),), rehab.training_ready, _replayed("rehab")),
    Row("fig17_rehab_errors", "Fig. 17 · Position error by mode", (_replay("rehab"),), rehab.errors_ready,
        _replayed("rehab")),
)  # fmt: skip
"""In the order of the page."""
