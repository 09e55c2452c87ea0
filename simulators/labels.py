"""The label rows that the simulated instruments encode by: GNSS sensor, inertial reference and radio altimeter."""

from collections import Counter

from decoders.definitions import Definition, load_definitions

SETS = ("gnss_743a", "iru_704", "ra_707")

_rows = [row for name in SETS for row in load_definitions(name).labels.values()]
_meanings = Counter(row.label for row in _rows)

# A label that two of the sets define says nothing without its equipment, so it is left out.
DEFINITIONS: dict[int, Definition] = {row.label: row for row in _rows if _meanings[row.label] == 1}
