"""What is said of the record at hand: events that gather until they are given."""

from gateway.events import Event, StatusEvent
from gateway.records import Record


class Telling:
    """`stamp` is what each event carries of the record that causes it: UTC in ns, and sequence."""

    def __init__(self) -> None:
        self.stamp: tuple[int, int] = (0, 0)
        self.begun = False  # whether there was any record
        self._events: list[Event] = []

    def begin(self, record: Record) -> None:
        """What is told from now on is caused by this record."""
        self.stamp, self.begun = (record.stamp.utc_ns, record.sequence), True

    def say(self, event: Event) -> None:
        """Add an event."""
        self._events.append(event)

    def tell(self, adapter: str, state: str, reason: str) -> None:
        """Add a status."""
        self.say(StatusEvent(*self.stamp, adapter, state, reason))

    def given(self) -> list[Event]:
        """All that was told since the last call."""
        events, self._events = self._events, []
        return events
