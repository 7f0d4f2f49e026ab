"""Fits from any recorded input: staircases, random steps, PRBS, multisine, chirp, the duty of a closed loop."""
