"""Every figure of the page: its name, its part of the page, what it needs, who makes that, and who draws it."""

from collections.abc import Callable
from dataclasses import dataclass

from eaid.report import ready_fits as fits
from eaid.report import ready_replays as replays
from eaid.report.figures import friction as frictions
from eaid.report.ready import Ready
from eaid.report.results import Results


@dataclass(frozen=True)
class Row:
    """One figure of the catalogue."""

    name: str
    """File name without ending."""
    title: str
    ready: Callable[[Results, bool | None], Ready | None]
    """The figure, or None where its data were not given."""
    made_by: str = ""
    """The command that makes what is missing; empty where its absence is no loss."""
    of_the_fit: bool = True
    """Whether it shows the fit of the clutch, or what was made from it; a mark of that fit goes on it then."""


_FIT = "eaid fit clutch.h5 -o fit.json"
_FORCE = "eaid fit friction-force.h5 -o friction-force.json"
_SPEED = "eaid fit friction-speed.h5 -o friction-speed.json"
_REPLAY = "eaid simulate fit.json --gains gains.json --scenario {0} -o {0}.h5"

FIGURES: tuple[Row, ...] = (
    Row("compare", "Two fits over each other", fits.compare_ready),
    Row("fig02_pwm", "Fig. 2 · One PWM period", fits.pwm_ready, of_the_fit=False),
    Row("edges", "Edges of the output", fits.edges_ready, of_the_fit=False),
    Row("fig06_hold_and_release", "Fig. 6 · Output while held and after release", fits.hold_ready,
        "eaid ingest LOGS (with the release recorded) -o data.h5", of_the_fit=False),
    Row("recorded_logs", "Logs as recorded", fits.recorded_ready),
    Row("fig07_nonlinear_model", "Fig. 7 · Nonlinear model", fits.nonlinear_ready, "eaid ingest LOGS -o clutch.h5"),
    Row("model_over_duty", "Parameters over the level", fits.over_duty_ready, _FIT),
    Row("residuals_nonlinear", "What the nonlinear model leaves", fits.residuals_ready("nonlinear", "clutch", True),
        _FIT),
    Row("bode", "Frequency response", fits.bode_ready),
    Row("level_steps", "Steps from level to level", fits.level_steps_ready, of_the_fit=False),
    Row("steps_over_level", "Gain and time constants of steps", fits.steps_over_level_ready, of_the_fit=False),
    Row("fig08_linear_model", "Fig. 8 · Linear model", fits.linear_ready, _FIT),
    Row("residuals_linear", "What the linear model leaves", fits.residuals_ready("linear", "clutch"), _FIT),
    Row("fig09_shear_per_field", "Fig. 9 · Shear stress over the electric field", fits.shear_ready),
    Row("fig03_friction_steps", "Fig. 3 · Friction steps", fits.friction_steps_ready, "eaid ingest LOGS -o friction.h5",
        of_the_fit=False),
    Row("fig04_friction_over_stress", "Fig. 4 · Friction over the normal stress",
        fits.trends_ready("friction-force", frictions.friction_over_stress), _FORCE, of_the_fit=False),
    Row("residuals_friction_force", "What the friction curves leave, over force",
        fits.residuals_ready("friction", "friction-force", True), _FORCE, of_the_fit=False),
    Row("fig05_friction_over_speed", "Fig. 5 · Friction over the rotation speed",
        fits.trends_ready("friction-speed", frictions.friction_over_speed), _SPEED, of_the_fit=False),
    Row("residuals_friction_speed", "What the friction curves leave, over speed",
        fits.residuals_ready("friction", "friction-speed"), _SPEED, of_the_fit=False),
    Row("input_gain", "Input gain of each level", fits.gain_ready, _FIT),
    Row("fig12_multisine", "Fig. 12 · Sum of sines", replays.tracking_ready("multisine"), _REPLAY.format("multisine")),
    Row("own_reference", "Your own reference", replays.tracking_ready("reference")),
    Row("fig11_steps", "Fig. 11 · Steps", replays.steps_ready, _REPLAY.format("steps")),
    Row("fig13_sweep", "Fig. 13 · Sines of rising frequency", replays.sweep_ready, _REPLAY.format("sweep")),
    Row("guarantee_in_replay", "What the robust term has to cover", replays.guarantee_ready,
        _REPLAY.format("multisine")),
    Row("walls", "How stiff a virtual wall may be", replays.walls_ready),
    Row("log_replay", "Recorded input through the model", replays.log_ready,
        "eaid simulate fit.json --log LOG -o log.h5"),
    Row("fig16_rehab", "Fig. 16 · Elbow rehabilitation", replays.training_ready, _REPLAY.format("rehab")),
    Row("fig17_rehab_errors", "Fig. 17 · Position error by mode", replays.errors_ready, _REPLAY.format("rehab")),
)  # fmt: skip
"""In the order of the page."""
