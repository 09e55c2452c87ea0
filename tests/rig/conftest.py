"""The rig's tests need a machine with devices of its own: `make rig-test` starts one, and all other runs pass by."""

import os

collect_ignore_glob = [] if "RIG_VM" in os.environ else ["test_*"]
