"""CfRadial 1.4 netCDF, one file a scan, for a radar on a moving platform.

Readers want one position a file, as fixed radars have: `latitude`, `longitude` and `altitude` are those of the ray in
the middle of the sweep, `platform_latitude` and so on those of each ray. `azimuth` and `elevation` are relative to
north and the horizon, `rotation` and `tilt` to the aircraft, about its vertical axis (axis_z). What is not known is a
fill value.
"""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import netCDF4
import numpy as np
from numpy.typing import NDArray

from decoders.formats import SCAN_ANGLE_LSB_DEG
from gateway.exports import Job
from gateway.exports.pointing import Place, look, place, platform
from gateway.exports.scans import Judged, judged, monitor_of
from monitor.geodesy import NM_M
from monitor.integrity import Monitor
from monitor.scans import Scan

STRING = 32  # characters
MISSING = -9999.0
MISSING_LEVEL = -128  # of the fields, whose levels and states are one signed byte
SECOND_NS = 1_000_000_000
SHADOW_STATES = {-3: "before_first_lit_bin", 0: "shadow", 1: "lit"}
MASKS = {"radar_shadow": SHADOW_STATES, "terrain_shadow": {**SHADOW_STATES, 2: "lit_peak"}}
UNITS = {"velocity": "meters per second", "altitude": "meters"}  # by how a name ends; everything else is in degrees


def export(job: Job, path: Path) -> str:
    """Write a directory with a file for each scan, named as CfRadial names files."""
    path.mkdir()
    monitor = monitor_of(job)
    count = 0
    for item in judged(job, monitor):
        if isinstance(item, Judged):
            try:
                write_scan(path / name_of(item), item, monitor)
            except RuntimeError as error:
                if not str(error).startswith("NetCDF"):  # which is how that library tells of a full disk
                    raise
                raise OSError(f"{error}, perhaps as the disk is full") from error
            count += 1
    return f"{count} scans, a file each"


def name_of(item: Judged) -> str:
    """The name of a scan's file: its first and its last ray, the instrument and the scan."""
    first, last = (_utc(int(time_ns)) for time_ns in (item.utc_ns.min(), item.utc_ns.max()))
    span = "_to_".join(f"{time:%Y%m%d_%H%M%S}.{time.microsecond // 1000:03d}" for time in (first, last))
    return f"cfrad.{span}_shadebus_{item.scan.number:05d}_SEC.nc"


def write_scan(path: Path, item: Judged, monitor: Monitor) -> None:
    """Write one scan."""
    scan = item.scan
    n, bins = scan.bins.shape
    attitude = platform(scan, item.aircraft)
    rays = place(scan, item.aircraft, attitude, monitor.settings.lever_arm)
    with netCDF4.Dataset(path, "w", format="NETCDF4", clobber=False) as file:
        for name, size in (("time", n), ("range", bins), ("sweep", 1), ("string_length", STRING)):
            file.createDimension(name, size)
        file.setncatts(_about(item, monitor))
        _times(file, item.utc_ns)
        _ranges(file, scan)
        _sweep(file, scan)
        _position(file, rays)
        beam = look(scan, attitude)
        named = dict(zip(("azimuth", "elevation", "rotation", "tilt"), beam, strict=True))
        own = dict(zip(("platform_latitude", "platform_longitude", "platform_altitude"), rays, strict=True))
        for name, values in {**named, **attitude, **own, "scan_angle": scan.scan_angle_deg}.items():
            _ray(file, name, values)
        file.createVariable("georefs_applied", "i1", ("time",))[:] = np.ones(n, np.int8)
        _field(file, "radar_level", scan.bins.astype(np.int8), dict(enumerate(item.profile.level_names)))
        for (name, meanings), states in zip(MASKS.items(), _masks(item, monitor), strict=True):
            _field(file, name, states, meanings)


def _utc(time_ns: int) -> datetime:
    return datetime.fromtimestamp(time_ns / SECOND_NS, UTC)


def _about(item: Judged, monitor: Monitor) -> dict[str, str | float]:
    """The global attributes: what CfRadial asks for, and the verdict; a number that was not found is left out."""
    scan, settings = item.scan, monitor.settings
    verdict = {name: value for name, value in vars(item.verdict).items() if value is not None}
    verdict |= {"reasons": "; ".join(item.verdict.reasons), "method": settings.method, "p_fa": settings.p_fa}
    return {
        "Conventions": "CF-1.7, CF/Radial",
        "version": "1.4",
        "title": "airborne weather radar, compared with stored terrain",
        "institution": "",
        "references": "",
        "source": "ARINC 708 radar words and ARINC 429 state, recorded by shadebus",
        "history": "",
        "comment": "latitude, longitude and altitude are those of the ray in the middle; see platform_latitude",
        "instrument_name": "shadebus",
        "platform_is_mobile": "true",
        "n_gates_vary": "false",
        "ray_times_increase": "true",
        "radar_mode": scan.mode,
        "radar_faults": scan.faults,
        "antenna_stabilised": "true" if scan.stabilised else "false",
        "rays_missing": scan.missing,
        **{f"shadebus_{name}": value for name, value in verdict.items()},
    }


def _times(file: netCDF4.Dataset, utc_ns: NDArray[np.int64]) -> None:
    start_s, end_s = int(utc_ns.min()) // SECOND_NS, -(-int(utc_ns.max()) // SECOND_NS)
    start = f"{_utc(start_s * SECOND_NS):%Y-%m-%dT%H:%M:%SZ}"
    _text(file, "time_coverage_start", start)
    _text(file, "time_coverage_end", f"{_utc(end_s * SECOND_NS):%Y-%m-%dT%H:%M:%SZ}")
    time = file.createVariable("time", "f8", ("time",))
    time.setncatts({"standard_name": "time", "units": f"seconds since {start}", "calendar": "gregorian"})
    time[:] = (utc_ns - start_s * SECOND_NS) / SECOND_NS


def _ranges(file: netCDF4.Dataset, scan: Scan) -> None:
    width_m = scan.range_nm * NM_M / scan.bins.shape[1]
    ranges = file.createVariable("range", "f4", ("range",))
    ranges.setncatts(
        {
            "standard_name": "projection_range_coordinate",
            "long_name": "range_to_center_of_measurement_volume",
            "units": "meters",
            "axis": "radial_range_coordinate",
            "spacing_is_constant": "true",
            "meters_to_center_of_first_gate": width_m / 2,
            "meters_between_gates": width_m,
        }
    )
    ranges[:] = (np.arange(scan.bins.shape[1]) + 0.5) * width_m


def _sweep(file: netCDF4.Dataset, scan: Scan) -> None:
    file.createVariable("volume_number", "i4").assignValue(scan.number)
    _text(file, "platform_type", "aircraft")
    _text(file, "instrument_type", "radar")
    _text(file, "primary_axis", "axis_z")
    _text(file, "sweep_mode", "sector", ("sweep",))
    for name, kind, value in (
        ("sweep_number", "i4", 0),
        ("fixed_angle", "f4", scan.tilt_deg),
        ("sweep_start_ray_index", "i4", 0),
        ("sweep_end_ray_index", "i4", len(scan.time_ns) - 1),
    ):
        file.createVariable(name, kind, ("sweep",))[:] = [value]
    file["fixed_angle"].units = "degrees"


def _position(file: netCDF4.Dataset, rays: Place) -> None:
    """The position of the ray in the middle of those that have one."""
    known = np.flatnonzero(np.isfinite(rays).all(axis=0))
    middle = known[len(known) // 2] if len(known) else None
    units = ("degrees_north", "degrees_east", "meters")
    for name, unit, values in zip(("latitude", "longitude", "altitude"), units, rays, strict=True):
        variable = file.createVariable(name, "f8", fill_value=MISSING)
        variable.setncatts({"standard_name": name, "units": unit})
        if middle is not None:
            variable.assignValue(values[middle])
    file["altitude"].positive = "up"


def _ray(file: netCDF4.Dataset, name: str, values: NDArray[np.float64]) -> None:
    """A variable of the rays; not a number becomes the fill value."""
    variable = file.createVariable(name, "f8", ("time",), fill_value=MISSING)
    variable.units = UNITS.get(name.rpartition("_")[2], "degrees")
    variable[:] = np.ma.masked_invalid(values)


def _field(file: netCDF4.Dataset, name: str, values: NDArray[np.int8], meanings: Mapping[int, str]) -> None:
    field = file.createVariable(name, "i1", ("time", "range"), fill_value=np.int8(MISSING_LEVEL), zlib=True)
    field.setncatts(
        {
            "long_name": name,
            "units": "1",
            "coordinates": "elevation azimuth range",
            "flag_values": np.array([*meanings], np.int8),
            "flag_meanings": " ".join(meaning.replace(" ", "_") for meaning in meanings.values()),
        }
    )
    field[:] = values


def _masks(item: Judged, monitor: Monitor) -> tuple[NDArray[np.int8], NDArray[np.int8]]:
    """Both threads on every ray that the monitor can compare, not only on those that enter its verdict."""
    scan = item.scan
    radar, terrain = (np.full(scan.bins.shape, MISSING_LEVEL, np.int8) for _ in range(2))
    every_ray = monitor.settings.model_copy(update={"radial_spacing_deg": SCAN_ANGLE_LSB_DEG / 2})
    compared = Monitor(monitor.terrain, every_ray).judge(scan, item.aircraft)[1] if item.comparison else None
    if compared:
        steady = np.flatnonzero(~scan.beyond_limits)
        order = steady[np.argsort(scan.scan_angle_deg[steady], kind="stable")]
        rays = order[np.searchsorted(scan.scan_angle_deg[order], compared.scan_angle_deg)]  # of equal angles the first
        radar[rays, : compared.radar_states.shape[1]] = compared.radar_states
        terrain[rays, : compared.dem_states.shape[1]] = compared.dem_states
    return radar, terrain


def _text(file: netCDF4.Dataset, name: str, text: str, dimensions: tuple[str, ...] = ()) -> None:
    variable = file.createVariable(name, "S1", (*dimensions, "string_length"))
    characters = netCDF4.stringtochar(np.array([text], f"S{STRING}"))
    variable[:] = characters if dimensions else characters[0]
