"""Pure functions: friction, nonlinear, linear and trend curves and their gradients."""
