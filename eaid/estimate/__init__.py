"""Records to estimates: forms of T_s, τ1, τ2 over the input, the solver, and intervals from whole runs."""
