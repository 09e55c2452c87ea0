"""Whether bridges on USB can be opened."""

import os
from pathlib import Path

from gateway.doctor.finding import Finding, access_mend
from gateway.kernel_devices import BRIDGE, bridge_nodes

VENDOR, PRODUCT = BRIDGE.split(":")
MATCH = f'SUBSYSTEM=="usb", ATTR{{idVendor}}=="{VENDOR}", ATTR{{idProduct}}=="{PRODUCT}"'


def permission(root: Path) -> Finding:
    """Whether this user may open the nodes of bridges that are plugged in."""
    found = bridge_nodes(root)
    closed = [node for node in found if not os.access(node, os.R_OK | os.W_OK)]
    if closed:
        names = ", ".join(f"/{node.relative_to(root)}" for node in closed)
        return Finding("USB permission", False, names, access_mend(closed[0], "usb", MATCH))
    return Finding("USB permission", True, f"{len(found)} can be opened" if found else f"no bridge ({BRIDGE})")
