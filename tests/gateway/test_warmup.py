"""Kernels are loaded before the first bytes; `make cold-start` measures how long it takes."""

import subprocess
import threading

import pytest

from gateway import service
from gateway.errors import GatewayError
from gateway.warmup import warm_up_gateway
from monitor.integrity import Monitor
from monitor.terrain import open_terrain
from simulators.outlets import PtyOutlet
from tests.gateway.conftest import TERRAIN, MakeRack
from tests.gateway.live import Live


def test_where_kernels_are_kept_no_other_process_compiles_them(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[object] = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: started.append(command))
    warm_up_gateway(Monitor(open_terrain(TERRAIN)))
    assert started == []


def test_what_comes_while_a_first_start_compiles_is_answered_although_it_is_stopped_meanwhile(
    make_rack: MakeRack, stream: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiling = threading.Event()
    monkeypatch.setattr(service, "LAST_WORDS_S", 1.0)  # shorter than it compiles
    monkeypatch.setattr(service, "warm_up_words", lambda: compiling.wait(60))
    with PtyOutlet() as line, Live(make_rack(f"serial:{line.path}")) as gateway:
        line.write(stream[:1000])
        gateway.wait_for_bytes(1000)
        stopped = threading.Thread(target=gateway.service.stop)
        stopped.start()
        stopped.join(1.5)
        assert stopped.is_alive() and gateway.lines == []
        compiling.set()
    assert gateway.service.failures == []
    assert gateway.events("summary")


def test_nothing_is_compiled_for_a_device_that_is_not_there(
    make_rack: MakeRack, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiled: list[str] = []
    monkeypatch.setattr(service, "warm_up_words", lambda: compiled.append("words"))
    with pytest.raises(GatewayError, match="no such device"):
        service.Service(make_rack("serial:/dev/no-such-line"), None, lambda _: None).start()
    assert compiled == []
