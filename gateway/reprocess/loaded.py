"""What a worker needs, loaded as this module is imported: by the process that workers are forked from."""

import distributed.nanny
import distributed.worker  # noqa: F401 # as the nanny is

import gateway.reprocess.job  # noqa: F401
from gateway.warmup import warm_up_words

warm_up_words()
