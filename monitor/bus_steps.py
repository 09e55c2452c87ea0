"""In what steps the buses tell where the radar antenna is and looks: each word's resolution, from its definition."""

from decoders.definitions import Definitions
from decoders.formats import SCAN_ANGLE_LSB_DEG, TILT_LSB_DEG
from monitor import quantities as state
from monitor.monte_carlo import Variables
from monitor.track import Quantity


def bus_steps(gnss: Definitions, inertial: Definitions) -> Variables:
    """The steps of the words of these sets and of the radar's own (ARINC 708); positions have fine words."""
    return Variables(
        latitude_deg=_step(state.LATITUDE, gnss),
        longitude_deg=_step(state.LONGITUDE, gnss),
        height_m=_step(state.HEIGHT, gnss),
        pitch_deg=_step(state.PITCH, inertial),
        roll_deg=_step(state.ROLL, inertial),
        heading_deg=_step(state.HEADING, inertial),
        azimuth_deg=SCAN_ANGLE_LSB_DEG,
        tilt_deg=TILT_LSB_DEG,
    )


def _step(quantity: Quantity, definitions: Definitions) -> float:
    box = definitions.equipment_id & 0xFF
    fine = [axis.fine for axis in state.AXES if axis.quantity == quantity and box in axis.equipment]
    whole = [row.label for row in state.SOURCES if row.quantity == quantity and box in row.equipment]
    definition = definitions.labels[(fine or whole)[0]]
    return float(definition.lsb) * state.SI[definition.units]
