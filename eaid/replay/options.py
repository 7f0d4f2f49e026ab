"""What a replay may be told, and what does nothing for which kind of replay."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from eaid.errors import UsageError
from eaid.limits import check_all
from eaid.replay.rig import Rig


def refuse_several(scenario: object, reference: object, log: object) -> None:
    """Refuse more than one of what may be replayed."""
    if sum(given is not None for given in (scenario, reference, log)) > 1:
        raise UsageError("«scenario», «reference» and «log» exclude each other; give one of them")


@dataclass(frozen=True)
class SimulateOptions:
    """What `simulate` may be told; a field that is out of its limits raises `UsageError`."""

    scenario: str | None = None
    """steps, multisine, sweep or rehab; None: multisine, where neither a reference nor runs are given."""
    controllers: tuple[str, ...] | None = None
    """None: rc and pi where there are gains; the sweep adds open-loop."""
    duration: float | None = None
    """Length of steps, multisine or rehab [s]."""
    rate_hz: float | None = None
    """Control rate; None: 1000 Hz, on a rig that is not the paper's that of its logs."""
    rig: Rig = Rig()  # noqa: RUF009 - frozen
    residual_noise: bool = False
    """Noise as large and as coloured as the fit's residuals of one run."""
    perturb: Mapping[str, float] = field(default_factory=dict)
    """Factors on tau1, tau2 and Ts that the controllers do not know."""
    plants: int | None = None
    """Also on so many plants drawn from the fit's uncertainty."""
    threads: int | None = None
    limb_damping: float | None = None
    """Of the rehabilitation [N·m·s/rad]."""
    limb_inertia: float | None = None
    """[kg·m²]"""
    keep_baseline: bool = False
    """Do not subtract the idle output of recorded runs."""
    seed: int = 0

    def __post_init__(self) -> None:
        check_all(
            duration=self.duration, rate_hz=self.rate_hz, plants=self.plants, threads=self.threads, seed=self.seed,
            limb_damping=self.limb_damping, limb_inertia=self.limb_inertia,
        )  # fmt: skip
        if self.threads is not None and self.plants is None:
            raise UsageError("«threads»: does nothing without «plants»; give both or neither")
        if self.scenario != "rehab" and (self.limb_damping is not None or self.limb_inertia is not None):
            raise UsageError("«limb_damping» and «limb_inertia» belong to «scenario» rehab")
        if self.residual_noise and (self.rig.noise_nm > 0 or self.rig.noise_correlation_s > 0):
            raise UsageError("noise as the residuals sets the noise; leave out «noise_nm» and «noise_correlation_s»")
        if self.rig.noise_correlation_s > 0 and not self.rig.noise_nm > 0 and not self.residual_noise:
            raise UsageError("«noise_correlation_s»: does nothing without «noise_nm»; give both or neither")

    def check_for(self, what: str) -> None:
        """Refuse what does nothing for a scenario, a `reference`, or recorded runs (`log`)."""
        if self.plants is not None and what in ("log", "rehab"):
            raise UsageError("«plants»: goes with steps, multisine, sweep or «reference»; leave it out")
        if self.rate_hz is not None and what == "log":
            raise UsageError("«rate_hz»: does not go with «log», which has a rate of its own; leave it out")
        if self.duration is not None and what in ("log", "reference"):
            raise UsageError(f"«duration»: does not go with «{what}»; the file says how long it is")
        if self.keep_baseline and what != "log":
            raise UsageError("«keep_baseline»: belongs to «log»; leave it out")
