"""Steps from rest to several levels: the estimate that is believed, the joint fit, the linear model, each level."""
