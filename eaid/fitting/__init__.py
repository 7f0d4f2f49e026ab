"""StepSet → fit: the scaled problem, the one SLSQP call, our own verdict."""
