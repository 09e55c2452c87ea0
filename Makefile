# Every target sets up what it needs in .venv; a machine with Python 3.11+, make and a C library is enough.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/ready

.PHONY: demo test rig-test lint bench live evidence latency load full-load hours soak crash agreement cold-start wide-terrain
.PHONY: rebaseline calibration dbc setup lock clean

demo: $(READY)
	$(BIN)/shadebus demo

test: lint
	$(BIN)/pytest --numprocesses 2 --dist loadfile

# The adapters against a real kernel and its devices, in a machine that QEMU emulates; see docs/rig.md. Plugins that
# these tests do not use would take longer to import there than the tests themselves.
rig-test: $(READY)
	tests/rig/vm.sh env PYTEST_DISABLE_PLUGIN_AUTOLOAD=1 \
	  $(BIN)/pytest -o addopts="-q --import-mode=importlib" -p no:cacheprovider --durations=5 tests/rig

lint: $(READY)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

bench: $(READY)
	$(BIN)/pytest benchmarks --benchmark-enable --benchmark-only
	$(BIN)/python -m benchmarks.live

# What the monitor's numbers are worth, into docs/evidence.md; half an hour on two cores.
evidence: $(READY)
	$(BIN)/python -m benchmarks.evidence

# How long the gateway computes from a radial that came in to its verdicts; the end of `make bench`.
live: $(READY)
	$(BIN)/python -m benchmarks.live

# Time from a full scan on the line to its verdict, at real bus rates.
latency: $(READY)
	$(BIN)/python -m benchmarks.latency

# What share of one core a rack at live rates takes.
load: $(READY)
	$(BIN)/python -m benchmarks.load

# Hours of recorded flight worked out again: times real time, cost against hours, memory; some minutes.
hours: $(READY)
	$(BIN)/python -m benchmarks.hours

# Full buses over each kind of line for a minute: words lost, share of a core, memory, and time to the event.
full-load: $(READY)
	$(BIN)/python -m benchmarks.full_load

# A quarter of an hour of faults on every kind of line at once: nothing may grow, nothing may be lost uncounted.
soak: $(READY)
	$(BIN)/python -m benchmarks.soak

# A gateway under full buses killed at 200 moments; `make test` takes 20.
crash: $(READY)
	CRASH_MOMENTS=200 $(BIN)/pytest tests/gateway/test_crash.py

# The events of the golden recordings as they are now, and what changed; the recordings stay.
rebaseline: $(READY)
	$(BIN)/python -m tests.golden.rebaseline

# The terrain thread beside programs of others, on real terrain; needs gdal-bin, and minutes.
agreement: $(READY)
	$(BIN)/python -m benchmarks.agreement

# How soon the gateway answers after its start, with compiled kernels kept and without.
cold-start: $(READY)
	$(BIN)/python -m benchmarks.cold_start

# A hundred tiles of an arc-second, 10 x 10 degrees: opening, scans along a track, peak memory.
wide-terrain: $(READY)
	$(BIN)/python -m benchmarks.wide_terrain

# The demo radar's calibration file, from flights that neither the demo nor `make evidence` uses.
calibration: $(READY)
	$(BIN)/python -m benchmarks.calibrate_demo

# The description of our CAN frames for CAN tools, from the formats and label sets.
dbc: $(READY)
	$(BIN)/python -m examples.dbc

setup: $(READY)

$(READY): requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14) and "shadebus needs Python 3.11 to 3.13: make PYTHON=python3.11")'
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes --no-deps -r requirements.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

# The lock is resolved for every supported Python and platform at once.
lock:
	$(PYTHON) -m venv .venv-lock
	.venv-lock/bin/pip install --quiet uv
	.venv-lock/bin/uv pip compile --quiet --universal --generate-hashes --no-emit-index-url --python-version 3.11 --group dev pyproject.toml -o requirements.lock
	rm -rf .venv-lock

clean:
	rm -rf .venv .mypy_cache .ruff_cache .pytest_cache .hypothesis .benchmarks build dist
