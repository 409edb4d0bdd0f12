"""Before numpy is imported: as in the command line, so that sums round alike, and two test
processes on two cores do not fight over threads for matrices of five rows."""

import os

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
