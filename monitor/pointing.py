"""Where the radar antenna was and looked on the radials of a scan, and why that is not known for others."""

import math

import numpy as np
from numpy.typing import NDArray

from monitor import quantities as state
from monitor.aircraft import Aircraft, status_name
from monitor.gate import position_doubts
from monitor.geodesy import HIGHEST_LATITUDE_DEG, body_to_enu, displace
from monitor.prediction import Pointing
from monitor.scans import Scan
from monitor.settings import LeverArm, MonitorSettings

Radials = NDArray[np.float64]

NEEDED = (state.LATITUDE, state.LONGITUDE, state.HEIGHT, state.PITCH, state.ROLL, state.HEADING)


def point(
    scan: Scan, aircraft: Aircraft, chosen: NDArray[np.intp], settings: MonitorSettings
) -> tuple[Pointing, NDArray[np.bool_], list[str]]:
    """The pointing of those of the `chosen` radials (n,) whose state is known, which these are, and why not others."""
    times = scan.time_ns[chosen]
    needed = (*NEEDED, state.RADIO_HEIGHT) if settings.uses_radio_altitude else NEEDED
    found = [aircraft.tracks[quantity.name].at(times) for quantity in needed]
    status = np.array([values.status for values in found])
    usable = (status == 0).all(axis=0)
    reasons = [
        f"{quantity.name}: {status_name(int(row[row > 0][0]))} on {np.count_nonzero(row)} of {len(times)} radials"
        for quantity, row in zip(needed, status, strict=True)
        if row.any()
    ]
    if settings.position_gate:
        doubtful, doubts = position_doubts(aircraft, times, settings.largest_integrity_limit_nm)
        usable &= ~doubtful
        reasons += doubts
    polar = usable & (np.abs(found[0].value) > HIGHEST_LATITUDE_DEG)
    if polar.any():
        usable &= ~polar
        reasons.append(f"{np.count_nonzero(polar)} radials start beyond {HIGHEST_LATITUDE_DEG:g} degrees of latitude")
    lat, lon, height, pitch, roll, heading = (values.value[usable] for values in found[: len(NEEDED)])
    place = antenna(lat, lon, height, settings.lever_arm, roll, pitch, heading)
    look = beam(scan, np.radians(scan.scan_angle_deg[chosen][usable]), roll, pitch, heading)
    return Pointing(*place, *look), usable, reasons


def antenna(
    latitude_deg: Radials,
    longitude_deg: Radials,
    height_m: Radials,
    arm: LeverArm,
    roll_deg: Radials,
    pitch_deg: Radials,
    heading_deg: Radials,
) -> tuple[Radials, Radials, Radials]:
    """Latitude, longitude and height (n,) of the radar antenna, from those of the GNSS antenna: degrees and metres."""
    ones = np.ones(len(latitude_deg))
    body = arm.forward_m * ones, arm.right_m * ones, arm.down_m * ones
    return displace(latitude_deg, longitude_deg, height_m, *body_to_enu(*body, roll_deg, pitch_deg, heading_deg))


def beam(
    scan: Scan, scan_angle_rad: Radials, roll_deg: Radials, pitch_deg: Radials, heading_deg: Radials
) -> tuple[Radials, Radials]:
    """Local-level azimuth and elevation (n,), radians; a stabilised antenna holds its angles against the horizon."""
    tilt_rad = np.full(len(scan_angle_rad), math.radians(scan.tilt_deg))
    if scan.stabilised:
        return np.radians(heading_deg) + scan_angle_rad, tilt_rad
    return boresight(scan_angle_rad, tilt_rad, roll_deg, pitch_deg, heading_deg)


def boresight(
    scan_angle_rad: Radials, tilt_rad: Radials, roll_deg: Radials, pitch_deg: Radials, heading_deg: Radials
) -> tuple[Radials, Radials]:
    """Local-level azimuth and elevation (n,), radians, of an antenna that is fixed to the body but for its scan."""
    level = np.cos(tilt_rad)
    look = level * np.cos(scan_angle_rad), level * np.sin(scan_angle_rad), -np.sin(tilt_rad)
    east, north, up = body_to_enu(*look, roll_deg, pitch_deg, heading_deg)
    return np.arctan2(east, north), np.arcsin(np.clip(up, -1, 1))
