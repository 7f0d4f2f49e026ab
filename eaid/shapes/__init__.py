"""Single steps: which curve each has, by evidence, from level to level or where the paper's does not do."""
