"""What the channels of a bridge carry, as the gateway reads them."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from decoders import formats as f
from decoders.arinc429 import JoinRule
from decoders.definitions import Definitions
from decoders.health429 import BusHealth
from decoders.profiles import Profile


@dataclass(frozen=True)
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

    def uses(self, words: NDArray[np.uint32], labels: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Which words (n,) come from the source that is to be used, as bits 9 and 10 say where they are no data."""
        sdi = words >> np.uint32(8) & np.uint32(3)
        if self.sdi is None:
            return np.ones(len(words), np.bool_)
        return np.asarray((sdi == 0) | (sdi == self.sdi) | ~self.health.has_sdi[labels])

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
