"""Where the radar antenna was and looked on every ray of a scan, in the earth's frame and in the aircraft's.

Platform angles are those of CfRadial 1.4, section 7, for a primary axis z: rotation about the aircraft's vertical axis,
clockwise from the nose, and tilt up from the plane of its wings. Whatever is not known is NaN.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monitor import quantities as state
from monitor.aircraft import Aircraft
from monitor.pointing import antenna, beam
from monitor.scans import Scan
from monitor.settings import LeverArm
from monitor.track import Quantity

Rays = NDArray[np.float64]
QUANTITIES = {
    "heading": state.HEADING,
    "roll": state.ROLL,
    "pitch": state.PITCH,
    "drift": state.DRIFT,
    "eastward_velocity": state.EAST,
    "northward_velocity": state.NORTH,
    "vertical_velocity": state.UP,
}


class Place(NamedTuple):
    """The radar antenna on each ray (n,): WGS 84 degrees, metres above mean sea level."""

    latitude_deg: Rays
    longitude_deg: Rays
    height_m: Rays


class Look(NamedTuple):
    """Where the beam points on each ray (n,), degrees: against true north and the horizon, and against the aircraft."""

    azimuth_deg: Rays
    elevation_deg: Rays
    rotation_deg: Rays
    tilt_deg: Rays


def platform(scan: Scan, aircraft: Aircraft) -> dict[str, Rays]:
    """By CfRadial's name, degrees and m/s of the aircraft on each ray; `heading` is true and lies in [0, 360)."""
    found = {name: _at(aircraft, quantity, scan) for name, quantity in QUANTITIES.items()}
    found["heading"] %= 360
    return found


def place(scan: Scan, aircraft: Aircraft, attitude: dict[str, Rays], arm: LeverArm) -> Place:
    """Where the radar antenna was: the GNSS position moved by the lever arm, as the monitor has it."""
    gnss = Place(*(_at(aircraft, quantity, scan) for quantity in (state.LATITUDE, state.LONGITUDE, state.HEIGHT)))
    if arm == LeverArm():  # of which the attitude need not be known
        return gnss
    roll, pitch, heading = (attitude[name] for name in ("roll", "pitch", "heading"))
    return Place(*antenna(*gnss, arm, roll, pitch, heading))


def look(scan: Scan, attitude: dict[str, Rays]) -> Look:
    """Where the beam pointed, as the monitor has it."""
    roll, pitch, heading = (attitude[name] for name in ("roll", "pitch", "heading"))
    azimuth, elevation = map(np.degrees, beam(scan, np.radians(scan.scan_angle_deg), roll, pitch, heading))
    if scan.stabilised:
        in_aircraft = _in_aircraft(azimuth, elevation, roll, pitch, heading)
    else:
        in_aircraft = scan.scan_angle_deg % 360, np.full(len(heading), scan.tilt_deg)
    return Look(azimuth % 360, elevation, *in_aircraft)


def _at(aircraft: Aircraft, quantity: Quantity, scan: Scan) -> Rays:
    found = aircraft.tracks[quantity.name].at(scan.time_ns)
    return np.where(found.status == 0, found.value, np.nan)


def _direction(bearing_deg: Rays, above_deg: Rays) -> tuple[Rays, Rays, Rays]:
    """Unit vectors ahead, to the right and up."""
    bearing, above = np.radians(bearing_deg), np.radians(above_deg)
    return np.cos(above) * np.cos(bearing), np.cos(above) * np.sin(bearing), np.sin(above)


def _in_aircraft(
    azimuth_deg: Rays, elevation_deg: Rays, roll_deg: Rays, pitch_deg: Rays, heading_deg: Rays
) -> tuple[Rays, Rays]:
    """Rotation and tilt of a direction in the earth's frame: heading, then pitch, then roll are taken back."""
    roll, pitch = np.radians(roll_deg), np.radians(pitch_deg)
    level_ahead, level_right, level_up = _direction(azimuth_deg - heading_deg, elevation_deg)
    ahead = level_ahead * np.cos(pitch) + level_up * np.sin(pitch)
    pitched_up = level_up * np.cos(pitch) - level_ahead * np.sin(pitch)
    right = level_right * np.cos(roll) - pitched_up * np.sin(roll)
    up = pitched_up * np.cos(roll) + level_right * np.sin(roll)
    return np.degrees(np.arctan2(right, ahead)) % 360, np.degrees(np.arcsin(np.clip(up, -1, 1)))
