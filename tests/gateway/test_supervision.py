"""No driver, however it fails, ends the supervision of its line."""

import termios
import threading
from collections.abc import Callable
from itertools import pairwise

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from gateway import supervision
from gateway.adapters import Reading, make_adapter, stream
from gateway.config import AdapterConfig
from gateway.supervision import Supervisor
from simulators.outlets import PtyOutlet
from tests.gateway.live import wait_until

ERRORS = (
    OSError(5, "Input/output error"),
    serial.SerialException("device reports readiness to read but returned no data"),
    termios.error(5, "Input/output error"),
    TypeError("'NoneType' object cannot be interpreted as an integer"),
    MemoryError(),
    KeyError("x"),
    ValueError("no"),
    AttributeError("gone"),
    RuntimeError("driver"),
    UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid"),
    StopIteration(),
    AssertionError(),
    RecursionError(),
    ExceptionGroup("several", [OSError(), ValueError()]),
)


class Fake:
    """A driver that acts by a script: each call of open, read or close takes the next step, errors are raised."""

    def __init__(self, script: list[tuple[str, Exception | bytes]]) -> None:
        self.script = script
        self.calls: list[str] = []

    def open(self) -> "Fake":
        self._act("open")
        return self

    def read(self) -> Reading:
        data = self._act("read")
        if not data:
            threading.Event().wait(0.001)
        return stream(data)

    def close(self) -> None:
        self._act("close")

    def _act(self, call: str) -> bytes:
        self.calls.append(call)
        if self.script and self.script[0][0] == call:
            step = self.script.pop(0)[1]
            if isinstance(step, Exception):
                raise step
            return step
        return b""


class Seen:
    """What the supervisor said and delivered, in order."""

    def __init__(self) -> None:
        self.states: list[tuple[str, str]] = []
        self.data = bytearray()

    def report(self, adapter: str, state: str, reason: str) -> None:
        assert adapter == "bridge"
        self.states.append((state, reason))

    def deliver(self, adapter: str, reading: Reading) -> None:
        assert adapter == "bridge"
        self.data += reading.data


def supervise(fake: Fake, until: Callable[[Seen], bool]) -> Seen:
    """Run a supervisor until something was seen, then stop it; its thread must end by itself."""
    seen, deaths = Seen(), []
    supervisor = Supervisor("bridge", fake, seen.deliver, seen.report)

    def work() -> None:
        try:
            supervisor.run()
        except BaseException as error:  # noqa: BLE001
            deaths.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        wait_until(lambda: until(seen) or deaths, "seen")
    finally:
        supervisor.stop()
        thread.join(10)
    assert not thread.is_alive()
    assert deaths == []
    return seen


@pytest.fixture(autouse=True, scope="module")
def short_waits() -> object:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(supervision, "FIRST_WAIT_S", 0.001)
        patch.setattr(supervision, "LONGEST_WAIT_S", 0.002)
        yield


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
@pytest.mark.parametrize("call", ["open", "read", "close"])
def test_an_error_at_any_call_is_told_and_the_line_opened_again(call: str, error: Exception) -> None:
    steps: list[tuple[str, Exception | bytes]] = [(call, error), ("read", b"words")]
    if call == "close":
        steps.insert(0, ("read", OSError("unplugged")))
    fake = Fake(steps)
    seen = supervise(fake, lambda seen: seen.data == b"words")
    assert seen.states[0] == ("OPENING", "")
    assert [state for state, _ in seen.states].count("UP") == (1 if call == "open" else 2)
    lost = [reason for state, reason in seen.states if state == "LOST"]
    assert lost == [f"{type(error).__name__}: {error}" if call != "close" else "OSError: unplugged"]
    assert seen.states[-1] == ("CLOSED", "")


STEPS = st.one_of(
    st.tuples(st.just("read"), st.binary(min_size=1, max_size=5)),
    st.tuples(st.sampled_from(["open", "read", "close"]), st.sampled_from(ERRORS)),
)


def reachable(steps: list[tuple[str, Exception | bytes]]) -> list[tuple[str, Exception | bytes]]:
    """The steps without those that no call would ever take: a line is opened and closed only around a failure."""
    script: list[tuple[str, Exception | bytes]] = []
    state = "open"
    for call, outcome in steps:
        failed = isinstance(outcome, Exception)
        if call == "read":
            script.append((call, outcome))
            state = "close" if failed else "read"
        elif call == state:
            script.append((call, outcome))
            state = "open"
    return script


@given(st.lists(STEPS, max_size=12))
def test_any_run_of_errors_and_bytes_delivers_the_bytes_and_ends_closed(
    steps: list[tuple[str, Exception | bytes]],
) -> None:
    script = [*steps, ("read", b"end")]
    expected = b"".join(step for _, step in script if isinstance(step, bytes))
    fake = Fake(reachable(script))
    seen = supervise(fake, lambda seen: bytes(seen.data) == expected)
    states = [state for state, _ in seen.states]
    assert states[-1] == "CLOSED"
    for before, after in pairwise(states):
        assert after in {"OPENING": ("UP", "LOST"), "UP": ("LOST", "CLOSED"), "LOST": ("OPENING", "CLOSED")}[before]
    assert fake.calls.count("open") == states.count("OPENING")
    assert fake.calls.count("close") == states.count("UP")


def test_waits_between_attempts_grow_to_the_longest_and_no_further(monkeypatch: pytest.MonkeyPatch) -> None:
    waits: list[float] = []
    supervisor = Supervisor("bridge", Fake([("open", OSError("gone"))] * 8), lambda *_: None, lambda *_: None)

    def wait(seconds: float) -> bool:
        waits.append(seconds)
        if len(waits) == 6:
            supervisor.stop()
        return False

    monkeypatch.setattr(supervision, "FIRST_WAIT_S", 0.5)
    monkeypatch.setattr(supervision, "LONGEST_WAIT_S", 5.0)
    monkeypatch.setattr(supervisor._stopping, "wait", wait)
    supervisor.run()
    assert waits == [0.5, 1.0, 2.0, 4.0, 5.0, 5.0]


def test_a_line_stays_lost_for_its_first_reason_and_the_attempts_are_counted() -> None:
    hung_up, gone = OSError("hung up"), OSError("gone")
    script: list[tuple[str, Exception | bytes]] = [
        ("read", hung_up),
        ("open", gone),
        ("open", hung_up),
        ("read", b"words"),
        ("read", gone),
        ("read", b"x"),
    ]
    seen = supervise(Fake(script), lambda seen: seen.data == b"wordsx")
    assert [reason for state, reason in seen.states if state == "LOST"] == [
        "OSError: hung up",
        "OSError: hung up (attempt 1 to open it again failed: OSError: gone)",
        "OSError: hung up (attempt 2 to open it again failed)",
        "OSError: gone",
    ]


def test_a_real_line_that_hangs_up_is_lost_for_that_reason() -> None:
    seen = Seen()
    with PtyOutlet() as line:
        adapter = make_adapter(AdapterConfig(name="bridge", source=line.place))
        supervisor = Supervisor("bridge", adapter, seen.deliver, seen.report)
        thread = threading.Thread(target=supervisor.run)
        thread.start()
        wait_until(lambda: ("UP", "") in seen.states, "UP")
    try:
        wait_until(lambda: [state for state, _ in seen.states].count("LOST") >= 3, "two attempts in vain")
    finally:
        supervisor.stop()
        thread.join(10)
    first, _, third, *_ = [reason for state, reason in seen.states if state == "LOST"]
    assert third.startswith(f"{first} (attempt 2 to open it again failed: serial line {line.path}: no such device")


def test_the_first_error_is_told_to_who_waits_for_it_and_later_ones_are_not() -> None:
    fake = Fake([("open", OSError("not there"))])
    supervisor = Supervisor("bridge", fake, lambda *_: None, lambda *_: None)
    thread = threading.Thread(target=supervisor.run)
    thread.start()
    assert supervisor.first_error(10) == "OSError: not there"
    supervisor.stop()
    thread.join(10)
    opened = Supervisor("bridge", Fake([]), lambda *_: None, lambda *_: None)
    thread = threading.Thread(target=opened.run)
    thread.start()
    assert opened.first_error(10) == ""
    opened.stop()
    thread.join(10)
