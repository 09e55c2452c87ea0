"""`shadebus import`: files to a recording, in one pass (two for candump, whose interfaces must be known first)."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from heapq import merge
from pathlib import Path
from typing import NoReturn

from decoders import formats as f
from decoders.framing import PacketFramer
from gateway.config import AdapterConfig, RackConfig
from gateway.errors import GatewayError
from gateway.framing import form_of, record_framer
from gateway.imports import Piece, candump
from gateway.imports.files import Source, cut
from gateway.imports.plan import Wish, rack_of
from gateway.imports.records import CHUNK_NS, SHARED_NS, Records
from gateway.link import FLAG_NAMES
from gateway.metadata import build_monitor, describe
from gateway.names import shown
from gateway.recording.layout import MAGIC
from gateway.recording.whole import write_whole
from gateway.records import Raw, Record

UTC_UNKNOWN = "the files say no UTC and --start-utc is not given: stamps count from 1970-01-01"
ASSUMED = {
    "seqrecord": "{tick_ns} ns a tick of the card's clock; the high byte of activity is the channel",
    "mxf429": "{tick_ns} ns a tick of the card's clock; masks of control {flags_429}",
    "mxf708": "{tick_ns} ns a tick of the card's clock; dataSize in units of {size_bits} bits; "
    "masks of control {flags_708}",
    "rdr4b": "the file has no times: {words_per_s:g} words a second, as if none were missing",
}

LOOKS: dict[str, Callable[[bytes], object]] = {  # by what a file without a word is said to be, and the mend
    "is an MCAP file, as recordings are: `shadebus replay` takes it as it is": lambda head: head.startswith(MAGIC),
    "is a log of candump: import it --from candump": lambda head: candump.LINE.fullmatch(head.partition(b"\n")[0]),
    "begins with zeros: look for another copy": lambda head: not any(head),
}
OTHER = "name its own layout with --from, or look for another copy"


def import_files(wish: Wish, out: Path, obey: Callable[[Iterable[Record]], Iterator[Record]]) -> dict[str, int]:
    """Make the recording `out`; counters of what is in it, by adapter. `obey` passes the records on until it is to end.

    Raises GatewayError for files that cannot be read and for what contradicts itself; then there is no recording.
    """
    sources = [Source(path) for path in wish.files]
    interfaces: dict[str, str] = {}
    start_utc_ns = 0
    if wish.layout == "candump":
        interfaces, start_utc_ns = candump.survey(sources)
    names = _names(wish, interfaces)
    config = rack_of(wish, names)
    opening = [] if interfaces else [_assumed(adapter) for adapter in config.adapters]
    if wish.start_utc_ns is not None:
        start_utc_ns = wish.start_utc_ns
    elif not interfaces:
        opening.append(UTC_UNKNOWN)
    sources = [Source(path) for path in wish.files]
    merged = len(names) > 1 and not interfaces
    chunk_ns = SHARED_NS if merged else CHUNK_NS
    maker = Records([*names], start_utc_ns, stamped=bool(interfaces), chunk_ns=chunk_ns)
    books = {adapter.name: Books(form_of(adapter).framer()) for adapter in config.adapters}

    def all_there_is() -> Iterator[Record]:
        for record in obey(maker.made(_pieces(config, sources, interfaces), opening)):
            if isinstance(record, Raw):
                books[record.adapter].take(record.data)
            yield record
        for name, files in _files_of(wish, names).items():
            if not interfaces and not books[name].words:  # a log without frames was refused already
                _refuse(files, wish.layout)
        yield from [maker.note(source.told) for source in sources]

    write_whole(out, describe(config, build_monitor(config)), all_there_is())
    clock = {"steps_back_in_time": maker.clock.steps_back, "clocks_begun_anew": maker.clock.begun_anew}
    return clock | {f"{name}.{key}": n for name, book in books.items() for key, n in book.counters().items()}


class Books:
    """What a replay will find in the chunks of an adapter."""

    def __init__(self, framer: PacketFramer) -> None:
        self._framer = framer
        self._words: Counter[str] = Counter()

    def take(self, data: bytes) -> None:
        """Count the packets and words of a chunk."""
        for packet in self._framer.feed(data):
            if packet.type == f.WORDS_429:
                self._words["words_429"] += len(packet.body) // 8
                self._words["words_429_flagged"] += len(packet.body) // 8 if packet.flags else 0
            elif packet.type == f.WORD_708:
                self._words["words_708"] += 1
                self._words["words_708_flagged"] += packet.flags > 0

    @property
    def words(self) -> int:
        """Words of either kind."""
        return self._words["words_429"] + self._words["words_708"]

    def counters(self) -> dict[str, int]:
        """Every counter by name."""
        return self._framer.counters() | self._words


def _assumed(adapter: AdapterConfig) -> str:
    """What the recording is to say of what its layout leaves open."""
    reading = vars(record_framer(adapter).reading)
    masks = {
        name: ", ".join(f"{FLAG_NAMES[flag]} 0x{mask:x}" for flag, mask in reading[name].items()) or "none"
        for name in ("flags_429", "flags_708")
    }
    return f"assumed of {adapter.name}: {ASSUMED[adapter.framing].format(**reading | masks)}"


def _names(wish: Wish, interfaces: Mapping[str, str]) -> dict[str, str]:
    """The adapters to be made, each with the place that its source names."""
    if interfaces:
        return {name: interface for interface, name in interfaces.items()}
    if wish.layout != "mxf":
        return {wish.layout: ",".join(shown(path.name) for path in wish.files)}
    if len(wish.channels) != len(wish.files):
        raise GatewayError(
            f"mxf records do not say their channel: give a --channel for each file, in the same order "
            f"({len(wish.files)} files, {len(wish.channels)} channels)"
        )
    return {f"mxf{k}": shown(path.name) for k, path in enumerate(wish.files)}


def _pieces(config: RackConfig, sources: list[Source], interfaces: dict[str, str]) -> Iterator[Piece]:
    """All that is in the files. Those of records that say their channel follow one another, others are merged."""
    if interfaces:
        return candump.frames(sources, interfaces)
    if len(config.adapters) == 1:
        (adapter,) = config.adapters
        return cut(sources, adapter.name, record_framer(adapter))
    pairs = zip(config.adapters, sources, strict=True)
    files = [cut([source], adapter.name, record_framer(adapter)) for adapter, source in pairs]
    return merge(*files, key=lambda piece: piece.time_ns or 0)


def _files_of(wish: Wish, names: Mapping[str, str]) -> dict[str, Sequence[Path]]:
    """The files of each adapter."""
    return {name: wish.files if len(names) == 1 else wish.files[k : k + 1] for k, name in enumerate(names)}


def _refuse(files: Sequence[Path], layout: str) -> NoReturn:
    """Raise GatewayError for files without a word, with what the first looks like."""
    with files[0].open("rb") as file:
        head = file.read(candump.LONGEST_LINE)
    seen = next(
        (name for name, looks_so in LOOKS.items() if looks_so(head)), f"begins with {head[:8].hex(' ')}: {OTHER}"
    )
    told = ", ".join(shown(str(path)) for path in files)
    raise GatewayError(f"{told}: no word could be read as {layout}: the file {seen}")
