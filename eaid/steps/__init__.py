"""Run → StepSet: step, level, baseline, window; averages of repeats; warnings."""
