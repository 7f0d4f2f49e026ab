"""The table of virtual walls."""

from eaid.report.style import controller_name
from eaid.report.tables.table import Table, columns
from eaid.results.coupling import Coupling


def walls_table(coupling: Coupling) -> Table:
    """How stiff a wall each loop may render at each torque."""
    options = coupling.options
    heads = columns(
        "loop", ("torque", coupling.output_unit, 3), ("passive", "N·m/rad", 3), ("stable", "N·m/rad", 3),
        ("lost at", "Hz", 3), ("replayed", "N·m/rad", 3),
    )  # fmt: skip
    rows = tuple(
        (controller_name(one.loop), one.torque_nm, one.K_passive, one.K_stable, one.lost_hz, one.K_replayed)
        for one in coupling.walls
    )
    caption = (
        f"Passive: on any passive limb of {options.limb_damping:g} N·m·s/rad. Stable: on this limb, "
        f"{options.limb_inertia:g} kg·m², linear and sampled. Replayed: the nonlinear plant. A dash: no limit."
    )
    return Table("How stiff a virtual wall may be", caption, heads, rows)
