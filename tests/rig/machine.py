"""What every device of the rig needs from the guest."""

import subprocess


def modprobe(*modules: str) -> None:
    """Load kernel modules, and what they need."""
    subprocess.run(["modprobe", "-a", *modules], check=True)
