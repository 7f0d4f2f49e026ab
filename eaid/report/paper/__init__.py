"""The paper, number by number, computed anew: docs/paper.md and `eaid reproduce`."""
