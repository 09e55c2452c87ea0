"""What a worker needs, loaded as this module is imported: by the process that workers are forked from."""

import gc
import logging
import signal
from importlib import import_module

signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C ends this process and its forks at once, as it does the parent
logging.disable()  # what a worker has to say is the outcome of a job, not that its scheduler ended before it
gc.disable()  # nothing that is loaded here becomes garbage, and to look for some takes a tenth of the time
for name in ("distributed.nanny", "distributed.worker", "gateway.reprocess.work"):
    import_module(name)
import_module("gateway.warmup").warm_up_words()
gc.freeze()
gc.enable()
