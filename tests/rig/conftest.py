"""The rig's tests need a machine with devices of its own: `make rig-test` starts one, and all other runs pass by."""

import os

import pytest

from decoders.racklink import Framer

collect_ignore_glob = [] if "RIG_VM" in os.environ else ["test_*"]


@pytest.fixture(scope="session", autouse=True)
def _framing_is_compiled() -> None:
    """An emulated processor takes half a minute to compile the loop over packets, while bytes come."""
    Framer().feed(b"\0")
