"""What to record next: `plan_recordings` turns a fit and wanted interval widths into a session on the rig."""

from eaid.planning.recordings import PlanOptions, plan_recordings

__all__ = ["PlanOptions", "plan_recordings"]
