"""The estimates of one model that stand beside each other in a fit.json, by name, the one that is used first."""

from collections.abc import Mapping
from typing import Any


def nonlinear_estimates(part: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Joint fit, two-stage estimate and the joint fit under the other weights, as far as they are there."""
    joint = part.get("joint") or part
    found = {_joint("sd" if "weights" in joint else "equal"): joint}
    if part.get("two_stage"):
        found["two-stage"] = part["two_stage"]
    if "joint" in part:
        found = {"two-stage": part, **found}
    other = joint.get("other_weights") or {}
    if "tau1" in other:
        found[_joint(str(other.get("weights")))] = other
    return found


def _joint(weights: str) -> str:
    return f"joint, {weights} weights"


def linear_estimates(part: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """The pooled linear model under the weights that were asked for, and under the other ones where they exist."""
    other = part.get("other_weights") or {}
    found = {f"{'sd' if 'weights' in part else 'equal'} weights": part}
    return {**found, f"{other.get('weights')} weights": other} if "a0" in other else found


def advice(part: Mapping[str, Any]) -> list[str]:
    """What a model's part says of the estimates beside each other: which to believe, and why; a sentence each."""
    says = part.get("agreement") or {}
    said = []
    for between, one in (("two-stage and joint", says), ("equal and sd weights", says.get("weights") or {})):
        because = one.get("because")
        if not because:
            continue
        if one.get("disagreements"):
            believe = NAMES.get(str(one.get("believe")), str(one.get("believe")))
            said.append(f"Between {between}, believe {believe}: {because}.")
        else:
            said.append(f"{because[:1].upper()}{because[1:]}.")
    return said


NAMES = {
    "joint": "the joint estimate",
    "two-stage": "the two-stage estimate",
    "neither": "neither",
    "equal": "equal weights",
    "sd": "sd weights",
}
"""What `agreement.believe` says, in words."""
