"""Speed beside the peers: `python -m benchmarks`, one table, both sides in the same run."""

import os

# Before numpy is loaded: one thread for everybody, and the processor's own BLAS kernels for the numpy peers.
os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
os.environ.pop("OPENBLAS_CORETYPE", None)
