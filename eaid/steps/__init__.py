"""Run → StepSet: step, level, baseline, window; averages of repeats; what is doubtful."""
