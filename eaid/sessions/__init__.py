"""Several fits of one rig: what its next session may be, what moved, and what one reference step says of today."""
