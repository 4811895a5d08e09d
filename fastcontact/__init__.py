"""fastcontact: fast finite elements for elastic contact problems.

Public names are imported on first use, which keeps ``import fastcontact`` at about 0.02 s.
"""

from __future__ import annotations

import logging
import os

from fastcontact._tools.lazy import lazy_names
from fastcontact._version import __version__ as __version__

# Without this setting, idle threads of OpenBLAS spin for about 0.1 s before they sleep. OpenBLAS reads the variable once,
# when NumPy or SciPy is first imported.
os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")

logging.getLogger(__name__).addHandler(logging.NullHandler())  # no output unless the user configures logging

__getattr__, __dir__, __all__ = lazy_names(__name__)
