"""What to record next: a fit and wanted interval widths → a session on the rig, or one sequence of inputs."""
