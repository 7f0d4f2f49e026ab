"""Every figure: its name, its title, what it needs, who makes that, and the function that describes it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter, methodcaller
from typing import Any

from eaid.report.figures import logs, replays, steps, values
from eaid.report.panels import Ready
from eaid.report.results import Results

Need = Callable[[Results], Any]


@dataclass(frozen=True)
class Row:
    """One figure of the catalogue."""

    name: str
    """File name without ending."""
    title: str
    needs: tuple[Need, ...]
    """What is given to `describe`, in this order; the figure is left out where one of them is None."""
    describe: Callable[..., Ready | None]
    made_by: str = ""
    """The command that makes what is missing; empty where its absence is no loss."""
    of_the_fit: bool = True
    """Whether it shows the fit of the clutch, or what was made from it; a mark of that fit goes on it then."""

    def ready(self, results: Results) -> Ready | None:
        """The figure, or None where its data were not given."""
        given = [need(results) for need in self.needs]
        made = None if any(one is None for one in given) else self.describe(*given)
        title = self.title if results.of_paper else self.title.split(" · ")[-1]
        return made and replace(made, title=made.title or title)


def _recorded(results: Results) -> Any:
    return next((one.result for one in results.fits if one.result.recorded is not None), None)


def _all(results: Results) -> Results:
    return results


_fit, _data, _replay = (partial(methodcaller, name) for name in ("fit", "data_of", "replay"))
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
    Row("fig02_pwm", "Fig. 2 · One PWM period", (_all,), values.pwm_period, of_the_fit=False),
    Row("edges", "Edges of the output", (attrgetter("edge_logs"),), logs.edges, of_the_fit=False),
    Row("fig06_hold_and_release", "Fig. 6 · Output while held and after release",
        (attrgetter("main_data"),), steps.hold_and_release, _MADE["held"], of_the_fit=False),
    Row("recorded_logs", "Logs as recorded", (_recorded,), logs.recorded_logs),
    Row("fig07_nonlinear_model", "Fig. 7 · Nonlinear model", (_data("clutch"), _all), steps.nonlinear_model,
        "eaid ingest LOGS -o clutch.h5"),
    Row("model_over_duty", "Parameters over the level", (_CLUTCH, _all), values.polynomials, _MADE["clutch"]),
    Row("residuals_nonlinear", "What the nonlinear model leaves", _ON_CLUTCH,
        partial(steps.residuals, "nonlinear"), _MADE["clutch"]),
    Row("bode", "Frequency response", (_recorded,), logs.bode),
    Row("level_steps", "Steps from level to level", (_all,), steps.level_steps, of_the_fit=False),
    Row("steps_over_level", "Gain and time constants of steps", (_all,), values.over_level,
        of_the_fit=False),
    Row("fig08_linear_model", "Fig. 8 · Linear model", _ON_CLUTCH, steps.linear_model, _MADE["clutch"]),
    Row("residuals_linear", "What the linear model leaves", _ON_CLUTCH,
        partial(steps.residuals, "linear"), _MADE["clutch"]),
    Row("fig09_shear_per_field", "Fig. 9 · Shear stress over the electric field", (_CLUTCH, _all),
        values.shear_per_field),
    Row("fig03_friction_steps", "Fig. 3 · Friction steps", (_all,), steps.friction_steps,
        "eaid ingest LOGS -o friction.h5", of_the_fit=False),
    Row("fig04_friction_over_stress", "Fig. 4 · Friction over the normal stress", (_fit("friction-force"), _all),
        values.trends, _MADE["force"], of_the_fit=False),
    Row("residuals_friction_force", "What the friction curves leave, over force", _ON_FORCE,
        partial(steps.residuals, "friction"), _MADE["force"], of_the_fit=False),
    Row("fig05_friction_over_speed", "Fig. 5 · Friction over the rotation speed", (_fit("friction-speed"), _all),
        values.trends, _MADE["speed"], of_the_fit=False),
    Row("residuals_friction_speed", "What the friction curves leave, over speed", _ON_SPEED,
        partial(steps.residuals, "friction"), _MADE["speed"], of_the_fit=False),
    Row("input_gain", "Input gain of each level", (_CLUTCH, _all), values.input_gain, _MADE["clutch"]),
    Row("fig12_multisine", "Fig. 12 · Sum of sines", (_replay("multisine"),), replays.tracking,
        _replayed("multisine")),
    Row("own_reference", "Your own reference", (_replay("reference"),), replays.tracking),
    Row("fig11_steps", "Fig. 11 · Steps", (_replay("steps"),), replays.tracking, _replayed("steps")),
    Row("fig13_sweep", "Fig. 13 · Sines of rising frequency", (_replay("sweep"),), replays.sweep,
        _replayed("sweep")),
    Row("guarantee_in_replay", "What the robust term has to cover", (attrgetter("replays"),),
        replays.guarantee, _replayed("multisine")),
    Row("walls", "How stiff a virtual wall may be", (attrgetter("couplings"),), replays.walls),
    Row("log_replay", "Recorded input through the model", (_replay("log"),), replays.recorded_input, _MADE["log"]),
    Row("fig16_rehab", "Fig. 16 · Elbow rehabilitation", (_replay("rehab"),), replays.training, _replayed("rehab")),
    Row("fig17_rehab_errors", "Fig. 17 · Position error by mode", (_replay("rehab"),), replays.errors,
        _replayed("rehab")),
)  # fmt: skip
"""In the order of the page."""
