"""Binary formats of other programs, read in a process of its own: `ask` is this side of it, `answer` the other."""
