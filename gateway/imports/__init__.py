"""Files of other recorders become recordings of ours: their bytes as they are, with stamps made of their times."""

from typing import NamedTuple


class Piece(NamedTuple):
    """The next bytes of an imported file that belong together.

    `time_ns` is by the clock of the file, None where there is none yet. `note` is for what cannot be kept as bytes.
    `ends` says that what follows does not belong to these bytes, even where they are a torn beginning.
    """

    time_ns: int | None
    adapter: str
    data: bytes
    note: str = ""
    ends: bool = False
