"""Controllers and plant as source for a rig, each export a folder that stands alone."""
