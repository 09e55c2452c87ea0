"""Who is heard and who fell silent: adapters by their packets, channels by their words, the radar by its radials."""

from collections.abc import Iterator, Mapping

QUIET_NS = 5_000_000_000
RADAR = "radar"  # the name under which the radar's silence is told, whatever its bridge still sends


class Hearing:
    """When each source was last heard, by the monotonic time of the records."""

    def __init__(self, advice: Mapping[str, str]) -> None:
        """`advice` says of each adapter what to look at where something comes, and no packet."""
        self._advice = advice
        self._heard_ns: dict[str, int] = {}
        self._bytes_ns: dict[str, int] = {}  # an adapter's last bytes, whatever they were
        self._quiet: set[str] = set()

    def expect(self, source: str, now_ns: int) -> None:
        """A source may speak from now on: one that never does is quiet too."""
        self._heard_ns.setdefault(source, now_ns)

    def bytes_came(self, adapter: str, now_ns: int) -> None:
        """Bytes came that need not be packets."""
        self._bytes_ns[adapter] = now_ns

    def heard(self, source: str, now_ns: int) -> str | None:
        """Take that a source spoke; if it had been quiet, say that it does no longer."""
        self._heard_ns[source] = now_ns
        if source not in self._quiet:
            return None
        self._quiet.discard(source)
        return f"{self._things(source)} come again"

    def is_quiet(self, source: str) -> bool:
        """Whether a source's silence was told, so that its next word is to be told too."""
        return source in self._quiet

    def silent_ns(self, source: str, now_ns: int) -> int:
        """How long a source has not been heard; 0 for one that is not expected."""
        return now_ns - self._heard_ns.get(source, now_ns)

    def may_fall_silent(self, now_ns: int) -> bool:
        """Whether `fell_silent` would give any source if none spoke until then."""
        return any(
            now_ns - heard_ns > QUIET_NS for source, heard_ns in self._heard_ns.items() if source not in self._quiet
        )

    def fell_silent(self, now_ns: int) -> Iterator[tuple[str, str]]:
        """The sources that have become quiet, and what to say of each."""
        for source in self._heard_ns:
            silent_ns = self.silent_ns(source, now_ns)
            if silent_ns > QUIET_NS and source not in self._quiet:
                self._quiet.add(source)
                yield source, self._reason(source, silent_ns, now_ns)

    def _reason(self, source: str, silent_ns: int, now_ns: int) -> str:
        silent = f"no {self._things(source)} for {silent_ns / 1e9:.1f} s"
        bytes_ns = self._bytes_ns.get(source)
        if bytes_ns is None or now_ns - bytes_ns > QUIET_NS:
            return silent
        return f"{silent}, though bytes come: {self._advice[source]}"

    def _things(self, source: str) -> str:
        return "packets" if source in self._advice else "words"
