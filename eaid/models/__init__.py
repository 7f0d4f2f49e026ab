"""Pure functions: friction, nonlinear, linear and trend curves, their gradients and first guesses."""
