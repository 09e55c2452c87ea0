"""Kernels are loaded before the first bytes; `make cold-start` measures how long it takes."""

import subprocess

import pytest

from gateway.warmup import warm_up_gateway
from monitor.integrity import Monitor
from monitor.terrain import open_terrain
from tests.gateway.conftest import TERRAIN


def test_where_kernels_are_kept_no_other_process_compiles_them(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[object] = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: started.append(command))
    warm_up_gateway(Monitor(open_terrain(TERRAIN)))
    assert started == []
