"""What the channels of a bridge carry, as the gateway reads them."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from decoders import formats as f
from decoders.arinc429 import JoinRule, Values429
from decoders.definitions import Definitions
from decoders.health429 import BusHealth
from decoders.profiles import Profile


@dataclass(frozen=True, eq=False)  # two that are read alike still are two, each with its own health
class Channel429:
    """An ARINC 429 channel: how to read its labels, when their values were true, and how well the bus behaves."""

    definitions: Definitions
    health: BusHealth
    kind: int
    is_panel: bool
    orientation: str
    join_rule: JoinRule
    sdi: int | None
    delays_ns: NDArray[np.int64]  # (256,), by label

    packet_type: ClassVar[int] = f.WORDS_429

    def reads(self, definitions: Definitions, orientation: str, kind: int) -> bool:
        """Whether it is read in this way already."""
        return (self.definitions, self.orientation, self.kind) == (definitions, orientation, kind)

    def of_source(
        self, time_ns: NDArray[np.int64], words: NDArray[np.uint32], values: Values429
    ) -> tuple[NDArray[np.int64], NDArray[np.uint32], Values429]:
        """The words (n,) of the source that is to be used, as bits 9 and 10 say where they are no data."""
        if self.sdi is None:
            return time_ns, words, values
        sdi = words >> np.uint32(8) & np.uint32(3)
        used = (sdi == 0) | (sdi == self.sdi) | ~self.health.has_sdi[values.label]
        return time_ns[used], words[used], Values429(*(column[used] for column in values))

    @property
    def role(self) -> str:
        """What only one channel can be at a time."""
        return f"source of equipment {self.definitions.equipment_id & 0xFF:02X}"


@dataclass(frozen=True)
class Channel708:
    """An ARINC 708 channel."""

    profile: Profile
    packet_type: ClassVar[int] = f.WORD_708
    role: ClassVar[str] = "radar"
