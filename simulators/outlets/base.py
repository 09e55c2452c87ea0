"""What every outlet is: something to write to, that waits for a slow reader and ends in good order."""

from types import TracebackType
from typing import Protocol, Self, TypeVar

POLL_S = 0.1
DRAIN_S = 1.0
STALL_S = 2.0  # no reader in its senses takes so long for 4 kB

Written_contra = TypeVar("Written_contra", contravariant=True)


class Closed(Exception):
    """The outlet was closed, or its reader has left."""


class Outlet(Protocol[Written_contra]):
    """What `play` writes to: bytes or CAN frames."""

    def write(self, unit: Written_contra, /) -> None:
        """Hand over the whole unit, waiting for a slow reader; raises Closed when there is none any more."""

    def close(self) -> None:
        """Let the reader finish, then release the resources; a second call does nothing."""


class Closing:
    """Closes on leaving a `with` block."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release the resources."""
        raise NotImplementedError
