"""Which label of which equipment gives which quantity of the aircraft."""

from functools import cache
from typing import Final, NamedTuple

from monitor.geodesy import FT_M, KT_M_S, NM_M
from monitor.track import Quantity

G_M_S2: Final = 9.80665
SI: Final = {
    "": 1.0, "deg": 1.0, "deg/s": 1.0, "m": 1.0, "ft": FT_M, "NM": NM_M, "kt": KT_M_S, "ft/min": FT_M / 60, "g": G_M_S2,
}  # fmt: skip # degrees stay degrees

LATITUDE = Quantity("latitude_deg", 2.5, angle=True)
LONGITUDE = Quantity("longitude_deg", 2.5, angle=True)
HEIGHT = Quantity("height_m", 2.5)
ELLIPSOID_HEIGHT = Quantity("ellipsoid_height_m", 2.5)
GNSS_MODE = Quantity("gnss_mode", 2.5, step=True)
SATELLITE_FAILURE = Quantity("gnss_satellite_failure", 2.5, step=True)
INTEGRITY_LIMIT = Quantity("horizontal_integrity_limit_m", 2.5, step=True)
HORIZONTAL_MERIT = Quantity("horizontal_figure_of_merit_m", 2.5, step=True)
VERTICAL_MERIT = Quantity("vertical_figure_of_merit_m", 2.5, step=True)
GNSS_SPEED = Quantity("gnss_ground_speed_m_s", 2.5)
GNSS_TRACK = Quantity("gnss_track_deg", 2.5, angle=True)
GNSS_NORTH = Quantity("gnss_north_velocity_m_s", 2.5)
GNSS_EAST = Quantity("gnss_east_velocity_m_s", 2.5)
GNSS_UP = Quantity("gnss_up_velocity_m_s", 2.5)
PITCH = Quantity("pitch_deg", 0.25, angle=True)
ROLL = Quantity("roll_deg", 0.25, angle=True)
HEADING = Quantity("heading_deg", 0.25, angle=True)
MAGNETIC_HEADING = Quantity("magnetic_heading_deg", 0.25, angle=True)
DRIFT = Quantity("drift_deg", 0.5, angle=True)
GROUND_SPEED = Quantity("ground_speed_m_s", 0.5)
TRACK_ANGLE = Quantity("track_deg", 0.5, angle=True)
NORTH = Quantity("north_velocity_m_s", 0.5)
EAST = Quantity("east_velocity_m_s", 0.5)
UP = Quantity("up_velocity_m_s", 0.5)
INERTIAL_LATITUDE = Quantity("inertial_latitude_deg", 1.0, angle=True)
INERTIAL_LONGITUDE = Quantity("inertial_longitude_deg", 1.0, angle=True)
INERTIAL_HEIGHT = Quantity("inertial_height_m", 0.5)
HYBRID_LATITUDE = Quantity("hybrid_latitude_deg", 1.0, angle=True)
HYBRID_LONGITUDE = Quantity("hybrid_longitude_deg", 1.0, angle=True)
HYBRID_HEIGHT = Quantity("hybrid_height_m", 0.5)
PRESSURE_ALTITUDE = Quantity("pressure_altitude_m", 0.5)
BARO_ALTITUDE = Quantity("baro_altitude_m", 0.5)
TRUE_AIRSPEED = Quantity("true_airspeed_m_s", 0.5)
RADIO_HEIGHT = Quantity("radio_height_m", 0.5)

GNSS, INERTIAL, HYBRID, AIR_DATA, RADIO = (0x0B,), (0x04, 0x05, 0x38), (0x38,), (0x06,), (0x07,)  # low byte of the id


class Source(NamedTuple):
    """A label of some equipment that gives a quantity, as its value or as discrete bits of it."""

    equipment: tuple[int, ...]
    label: int
    quantity: Quantity
    bits: str = ""


SOURCES = (
    Source(GNSS, 0o076, HEIGHT),
    Source(GNSS, 0o370, ELLIPSOID_HEIGHT),
    Source(GNSS, 0o103, GNSS_TRACK),
    Source(GNSS, 0o112, GNSS_SPEED),
    Source(GNSS, 0o130, INTEGRITY_LIMIT),
    Source(GNSS, 0o130, SATELLITE_FAILURE, "satellite_failure"),
    Source(GNSS, 0o136, VERTICAL_MERIT),
    Source(GNSS, 0o165, GNSS_UP),
    Source(GNSS, 0o166, GNSS_NORTH),
    Source(GNSS, 0o174, GNSS_EAST),
    Source(GNSS, 0o247, HORIZONTAL_MERIT),
    Source(GNSS, 0o273, GNSS_MODE, "mode"),
    Source(INERTIAL, 0o310, INERTIAL_LATITUDE),
    Source(INERTIAL, 0o311, INERTIAL_LONGITUDE),
    Source(INERTIAL, 0o312, GROUND_SPEED),
    Source(INERTIAL, 0o313, TRACK_ANGLE),
    Source(INERTIAL, 0o314, HEADING),
    Source(INERTIAL, 0o320, MAGNETIC_HEADING),
    Source(INERTIAL, 0o321, DRIFT),
    Source(INERTIAL, 0o324, PITCH),
    Source(INERTIAL, 0o325, ROLL),
    Source(INERTIAL, 0o361, INERTIAL_HEIGHT),
    Source(INERTIAL, 0o365, UP),
    Source(INERTIAL, 0o366, NORTH),
    Source(INERTIAL, 0o367, EAST),
    Source(HYBRID, 0o261, HYBRID_HEIGHT),
    Source(AIR_DATA, 0o203, PRESSURE_ALTITUDE),
    Source(AIR_DATA, 0o204, BARO_ALTITUDE),
    Source(AIR_DATA, 0o210, TRUE_AIRSPEED),
    Source(RADIO, 0o164, RADIO_HEIGHT),
)


class Axis(NamedTuple):
    """The coarse and fine labels of one coordinate."""

    equipment: tuple[int, ...]
    coarse: int
    fine: int
    quantity: Quantity


AXES = (
    Axis(GNSS, 0o110, 0o120, LATITUDE),
    Axis(GNSS, 0o111, 0o121, LONGITUDE),
    Axis(HYBRID, 0o254, 0o256, HYBRID_LATITUDE),
    Axis(HYBRID, 0o255, 0o257, HYBRID_LONGITUDE),
)
SOURCES_OF: Final = {
    (equipment, source.label): [row for row in SOURCES if equipment in row.equipment and row.label == source.label]
    for source in SOURCES
    for equipment in source.equipment
}
AXIS_OF: Final = {(equipment, label): axis for axis in AXES for equipment in axis.equipment for label in axis[1:3]}
QUANTITIES = tuple({row.quantity.name: row.quantity for row in (*SOURCES, *AXES)}.values())
ROW_OF: Final = {quantity.name: row for row, quantity in enumerate(QUANTITIES)}  # of their samples


@cache
def are_distinct(equipment: tuple[int, ...]) -> bool:
    """Whether no quantity is given by two of these boxes."""
    given = [row.quantity.name for box in equipment for row in (*SOURCES, *AXES) if box in row.equipment]
    return len(set(given)) == len(given)
