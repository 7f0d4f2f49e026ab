"""What is timed against other tools; BLAS keeps to one thread, here as in `eaid fit`."""

import os

for _name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
