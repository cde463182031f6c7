import os

# Each worker of pytest-xdist has one core: threads of BLAS would only compete.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
