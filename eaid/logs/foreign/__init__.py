"""Binary formats of other programs, read in a process of its own: `answer` is its side, `logs.formats` this one."""
