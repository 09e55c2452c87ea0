"""What a check finds, and the commands that mend more than one lack."""

import grp
from pathlib import Path
from typing import NamedTuple

OPEN_GROUP = "dialout"  # Debian's for whoever may open serial lines


class Finding(NamedTuple):
    """One check: what was looked at, whether it is good, what was seen, and the mend if it is not."""

    check: str
    good: bool
    seen: str
    mend: str = ""


def udev_mend(name: str, rule: str) -> str:
    """The command that writes a udev rule and has it work at once."""
    write = f"echo '{rule}' | sudo tee /etc/udev/rules.d/70-shadebus-{name}.rules"
    return f"{write} && sudo udevadm control --reload && sudo udevadm trigger"


def access_mend(device: Path, name: str, match: str) -> str:
    """The command that lets this user open a device: joining its group, or a udev rule where that is root's."""
    try:
        group = grp.getgrgid(device.stat().st_gid).gr_name
    except (KeyError, OSError):
        group = OPEN_GROUP
    if group != "root":
        return _join(group)
    rule = f'{match}, GROUP="{OPEN_GROUP}", MODE="0660"'
    return f"{udev_mend(name, rule)} && {_join(OPEN_GROUP)}"


def _join(group: str) -> str:
    return f"sudo usermod -aG {group} $USER, then log in again"
