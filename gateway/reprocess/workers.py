"""The process that workers are forked from: it has imported and loaded all that they need, so each begins at once.

Started first of all, it gets ready while its parent imports what the parent needs.
"""

import os
import signal
from multiprocessing import forkserver, set_forkserver_preload
from typing import Final

LOADED: Final = "gateway.reprocess.loaded"
KEPT_BYTES: Final = 1 << 28  # of freed memory; to give it back and ask for it again takes a tenth of the time
ENVIRONMENT: Final = {
    "MALLOC_TRIM_THRESHOLD_": str(KEPT_BYTES),
    "MALLOC_MMAP_THRESHOLD_": str(KEPT_BYTES),
    "PYTHONWARNINGS": "ignore:resource_tracker",  # which says what it cleans up after Ctrl-C
}


def get_ready() -> None:
    """Start that process unless it runs."""
    before = dict(os.environ)
    at_interrupt = signal.signal(signal.SIGINT, signal.SIG_IGN)  # or Python, as it begins, takes it with a traceback
    os.environ.update(ENVIRONMENT)  # the C library reads it as a process begins, and forks keep what it read
    try:
        set_forkserver_preload([LOADED])
        forkserver.ensure_running()
    finally:
        os.environ.clear()
        os.environ.update(before)
        signal.signal(signal.SIGINT, at_interrupt)
