"""What a worker needs, loaded as this module is imported: by the process that workers are forked from."""

import gc
from importlib import import_module

gc.disable()  # nothing that is loaded here becomes garbage, and to look for some takes a tenth of the time
for name in ("distributed.nanny", "distributed.worker", "gateway.reprocess.work"):
    import_module(name)
import_module("gateway.warmup").warm_up_words()
gc.freeze()
gc.enable()
