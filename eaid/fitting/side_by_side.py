"""The estimates of one model that stand beside each other in a fit.json, by name, the one that is used first."""

from collections.abc import Mapping
from typing import Any


def nonlinear_estimates(part: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Joint fit, two-stage estimate and the joint fit under the other weights, as far as they are there."""
    joint = part.get("joint") or part
    found = {_joint(str(joint.get("weights", "equal"))): joint}
    if part.get("two_stage"):
        found["two-stage"] = part["two_stage"]
    if "joint" in part:
        found = {"two-stage": part, **found}
    other = part.get("other_weights") or {}
    if "tau1" in other:
        found[_joint(str(other.get("weights")))] = other
    return found


def _joint(weights: str) -> str:
    return f"joint, {weights} weights"


def linear_estimates(part: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """The pooled linear model under the weights that were asked for, and under the other ones where they exist."""
    other = part.get("other_weights") or {}
    found = {f"{part.get('weights', 'equal')} weights": part}
    return {**found, f"{other.get('weights')} weights": other} if "a0" in other else found


def advice(part: Mapping[str, Any]) -> list[str]:
    """The findings of a model's part, as sentences."""
    return [str(text) for text in part.get("warnings") or []]
