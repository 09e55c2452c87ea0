"""Imports point one way, the encoders share nothing that packs or unpacks, and nothing can talk on a bus."""

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import pytest

from gateway.adapters import KINDS

ROOT = Path(__file__).parent.parent
PACKAGES = ("decoders", "monitor", "gateway", "simulators")
MAY_IMPORT = {
    "decoders": set[str](),
    "monitor": {"decoders"},
    "gateway": {"decoders", "monitor", "simulators"},  # the last one in two places only, see below
    "simulators": {"decoders"},
}
SHARED_WITH_SIMULATORS = {"decoders.formats", "decoders.definitions"}
MAY_SIMULATE = {"gateway/demo.py", "gateway/cli/simulate.py"}


class Import(NamedTuple):
    file: str
    module: str
    lazy: bool  # inside a function

    @property
    def package(self) -> str:
        return self.module.partition(".")[0]


def trees(*packages: str) -> Iterator[tuple[str, ast.Module]]:
    for package in packages:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield path.relative_to(ROOT).as_posix(), ast.parse(path.read_text(encoding="utf-8"))


def imports(package: str) -> Iterator[Import]:
    """Every import of a package, `from a import b` as a.b wherever that is a module."""
    for file, tree in trees(package):
        functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
        lazy = {id(inner) for function in functions for inner in ast.walk(function)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{file}: imports are absolute here, so that this test can read them"
                names = [full_name(str(node.module), alias.name) for alias in node.names]
            else:
                continue
            yield from (Import(file, name, id(node) in lazy) for name in names)


def full_name(module: str, name: str) -> str:
    inside = ROOT / module.replace(".", "/") / name
    return f"{module}.{name}" if inside.with_suffix(".py").exists() or inside.is_dir() else module


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_imports_only_those_below_it(package: str) -> None:
    found = {item.package for item in imports(package)} & {*PACKAGES, "tests", "benchmarks"}
    assert found - {package} <= MAY_IMPORT[package]


@pytest.mark.parametrize("package", ["decoders", "monitor"])
def test_decoding_and_judging_touch_no_clock_no_thread_and_no_line(package: str) -> None:
    forbidden = {"time", "datetime", "threading", "asyncio", "socket", "select", "subprocess", "serial", "random"}
    assert {item for item in imports(package) if item.package in forbidden} == set()


def test_simulators_share_only_formats_and_label_tables_with_the_decoders() -> None:
    shared = {item.module for item in imports("simulators") if item.package == "decoders"}
    assert shared == SHARED_WITH_SIMULATORS


def test_the_gateway_simulates_only_where_it_is_asked_to_and_lazily() -> None:
    found = [item for item in imports("gateway") if item.package == "simulators"]
    assert {item.file for item in found} == MAY_SIMULATE
    assert [item for item in found if not item.lazy] == []


def test_the_command_line_imports_its_work_lazily() -> None:
    eager = {item.module for item in imports("gateway") if item.file.startswith("gateway/cli/") and not item.lazy}
    assert {module for module in eager if module.startswith("gateway")} <= {
        "gateway.errors",
        "gateway.kernel_cache",
        "gateway.names",
        *(f"gateway.cli.{path.stem}" for path in (ROOT / "gateway" / "cli").glob("*.py")),
    }
    assert {module.partition(".")[0] for module in eager} <= {
        "gateway",
        "typer",
        "typing",
        "collections",
        "io",
        "os",
        "pathlib",
        "sys",
        "signal",
        "threading",
    }


TALKING = {"send", "sendall", "sendto", "sendmsg", "sendfile", "send_periodic", "send_break", "transmit"}
WRITING = {"write", "writelines", "bulk_write", "intr_write", "iso_write", "ctrl_transfer"}


def calls(*packages: str) -> Iterator[tuple[str, str]]:
    """Each method called, and where."""
    for file, tree in trees(*packages):
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                yield f"{file}:{node.lineno}", node.func.attr


def test_nothing_in_the_service_can_talk_on_a_bus() -> None:
    service = [(place, name) for place, name in calls("gateway") if place.partition(":")[0] not in MAY_SIMULATE]
    assert len(service) > 500, "the walk found hardly any calls"
    assert [(place, name) for place, name in service if name in TALKING] == []
    assert [(place, name) for place, name in calls("gateway/adapters") if name in WRITING] == []


@pytest.mark.parametrize("kind", KINDS)
def test_an_open_line_offers_reading_and_closing_and_nothing_else(kind: str) -> None:
    module = import_module(KINDS[kind])
    made_here = [
        thing for thing in vars(module).values() if isinstance(thing, type) and thing.__module__ == KINDS[kind]
    ]
    offered = {thing: {name for name in vars(thing) if not name.startswith("_")} for thing in made_here}
    assert [offers for offers in offered.values() if "read" in offers]
    for offers in offered.values():
        assert offers in ({"read", "close"}, {"open"}, {"open", "name"})


def test_the_walk_sees_what_it_must() -> None:
    found = {(item.file, item.module, item.lazy) for item in imports("gateway")}
    assert ("gateway/pipeline.py", "decoders.formats", False) in found
    assert ("gateway/cli/run.py", "gateway.service", True) in found
