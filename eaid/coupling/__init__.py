"""How stiff a virtual wall a torque loop may render on a limb: passive, stable, and replayed (docs/coupling.md)."""
