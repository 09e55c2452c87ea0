"""A rack file is checked as a whole before anything opens, and errors say where and what."""

import re
from pathlib import Path

import pytest
import rasterio
from rasterio.transform import Affine

from gateway.channels import Channel429, Channel708
from gateway.config import RackConfig, TomlFile, check_config, load_config, profile_of
from gateway.errors import GatewayError
from gateway.link import Link
from gateway.metadata import build_monitor, describe, recorded_config

ADAPTER = '[[adapters]]\nname = "bridge"\nsource = "serial:/dev/x"\n'


def load(tmp_path: Path, text: str) -> RackConfig:
    (tmp_path / "rack.toml").write_text(text)
    return load_config(tmp_path / "rack.toml")


def test_a_small_rack_file_is_enough(tmp_path: Path) -> None:
    config = load(tmp_path, ADAPTER)
    assert config.adapters[0].baud == 921_600
    assert config.recording is None
    assert config.terrain == ()


def test_paths_count_from_where_the_rack_file_lies(tmp_path: Path) -> None:
    maps = 'terrain = ["a.hgt", "/b.hgt"]\nwater = ["w.tif", "/w.geojson"]\n'
    text = f'{maps}calibration = "c.json"\n{ADAPTER}[recording]\ndirectory = "d"\n'
    config = load(tmp_path, text)
    assert config.terrain == (tmp_path / "a.hgt", Path("/b.hgt"))
    assert config.water == (tmp_path / "w.tif", Path("/w.geojson"))
    assert config.calibration == tmp_path / "c.json"
    assert config.recording is not None
    assert config.recording.directory == tmp_path / "d"


def test_a_path_may_begin_in_the_user_s_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    (home / "radar.toml").write_text(OWN_PROFILE)
    maps = 'terrain = ["~/a.hgt"]\nwater = ["~/w.tif"]\ncalibration = "~/c.json"\nradar_profile = "~/radar.toml"\n'
    config = load(tmp_path, f'{maps}{ADAPTER}[recording]\ndirectory = "~/d"\n')
    assert (*config.terrain, *config.water) == (home / "a.hgt", home / "w.tif")
    assert config.calibration == home / "c.json"
    assert config.radar_profile == TomlFile(path=home / "radar.toml", text=OWN_PROFILE)
    assert config.recording is not None
    assert config.recording.directory == home / "d"
    for option, where in (
        ('terrain = ["~nobody-here/a"]', r"terrain\.0"),
        ('radar_profile = "~nobody-here/a.toml"', ""),
    ):
        said = f"{where}.*: ~nobody-here/a.* begins in a home that there is not: write the whole path"
        with pytest.raises(GatewayError, match=said):
            load(tmp_path, f"{option}\n{ADAPTER}")


@pytest.mark.parametrize(
    ("option", "wanted"),
    [
        ('baud = "9600"', "baud: Input should be a valid integer"),
        ("baud = 9600.0", "baud: Input should be a valid integer"),
        ("baud = true", "baud: Input should be a valid integer"),
        ("name = 7", "name: Input should be a valid string"),
        ("source = 7", "source: Input should be a valid string"),
        ("framing = 7", "framing: Input should be 'racklink', "),
        ("vendor = 7", "vendor: write a table of options"),
        ('vendor = { tick_ns = "40" }', "vendor.tick_ns: Input should be a valid integer"),
        ('vendor = { size_bits = "8" }', "vendor.size_bits: Input should be 1, 8 or 16"),
        ("vendor = { size_bits = 8.0 }", "vendor.size_bits: write 1, 8 or 16"),
        ("vendor = { size_bits = true }", "vendor.size_bits: write 1, 8 or 16"),
        ('vendor = { words_per_s = "180" }', "vendor.words_per_s: Input should be a valid number"),
        ('vendor = { flags_429 = { parity = "1" } }', "vendor.flags_429.parity: Input should be a valid integer"),
        ("vendor = { flags_708 = 1 }", "vendor.flags_708: write a table"),
        ("channels = 7", "channels: write a table"),
        ('channels = { x = { kind = "arinc429" } }', r"channels.x.\[key\]: 'x' is no channel: write plain digits"),
        ('channels = { 1 = { kind = "arinc429", sdi = "1" } }', "channels.1.sdi: Input should be a valid integer"),
        ('channels = { 1 = { kind = "arinc429", sdi = true } }', "channels.1.sdi: Input should be a valid integer"),
        (
            'channels = { 1 = { kind = "arinc429", delays_ms = { 110 = "3" } } }',
            "channels.1.delays_ms.110: Input should be a valid number",
        ),
    ],
)
def test_a_value_of_another_kind_in_an_adapter_is_refused_with_what_it_takes(
    tmp_path: Path, option: str, wanted: str
) -> None:
    key = option.partition(" ")[0]
    lines = [line for line in ADAPTER.splitlines() if not line.startswith(f"{key} =")]
    with pytest.raises(GatewayError, match=rf"rack\.toml: adapters\.0\.{wanted}"):
        load(tmp_path, "\n".join([*lines, option]))


@pytest.mark.parametrize(
    ("option", "wanted"),
    [
        ('terrain = "a.hgt"', "terrain: write a list, in brackets"),
        ("terrain = [7]", "terrain.0: write a path, in quotes"),
        ("water = [true]", "water.0: write a path, in quotes"),
        ("calibration = 7", "calibration: write a path, in quotes"),
        ("wait_for_devices = 1", "wait_for_devices: Input should be a valid boolean"),
        ('wait_for_devices = "true"', "wait_for_devices: Input should be a valid boolean"),
        ("recording = true", "recording: write a table of options"),
        ('recording = { sync_interval_s = "1" }', "recording.sync_interval_s: Input should be a valid number"),
        ("recording = { rotate_minutes = true }", "recording.rotate_minutes: Input should be a valid number"),
        ("recording = { rotate_mib = 2026-05-28 }", "recording.rotate_mib: Input should be a valid number"),
        ('recording = { reserve_mib = "256" }', "recording.reserve_mib: Input should be a valid number"),
        ("recording = { queue_mib = 64.0 }", "recording.queue_mib: Input should be a valid integer"),
        ("recording = { directory = 7 }", "recording.directory: write a path, in quotes"),
        ('monitor = { lever_arm = "none" }', "monitor.lever_arm: write a table of options"),
    ],
)
def test_a_value_of_another_kind_is_refused_with_what_it_takes(tmp_path: Path, option: str, wanted: str) -> None:
    with pytest.raises(GatewayError, match=rf"rack\.toml: {wanted}$"):
        load(tmp_path, f"{option}\n{ADAPTER}")


def test_integers_are_numbers_and_keys_of_tables_are_channels(tmp_path: Path) -> None:
    text = f"""recording = {{ sync_interval_s = 2, rotate_mib = 0, directory = "d" }}
monitor = {{ beam_width_deg = 4 }}
{ADAPTER}
vendor = {{ words_per_s = 180, size_bits = 8, flags_708 = {{ sync = 0x10 }} }}
[adapters.channels.17]
kind = "arinc429"
delays_ms = {{ 110 = 3 }}
"""
    config = load(tmp_path, text)
    assert config.recording is not None
    assert (config.recording.sync_interval_s, config.monitor.beam_width_deg) == (2.0, 4.0)
    (adapter,) = config.adapters
    assert adapter.vendor.model_dump(exclude_none=True) == {
        "words_per_s": 180.0, "size_bits": 8, "flags_708": {"sync": 16},
    }  # fmt: skip
    assert adapter.channels[17].delays_ms == {"110": 3.0}
    assert recorded_config(describe(config, None)) == config


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("", r"adapters: name at least one, as \[\[adapters\]\]"),
        ("adapters = []", r"adapters: name at least one, as \[\[adapters\]\]"),
        (ADAPTER + "speed = 9600", "adapters.0.speed: there is no such option"),
        (ADAPTER + "baud = 10", "adapters.0.baud: .*300"),
        (ADAPTER.replace("serial:", "serial"), "adapters.0.source"),
        (ADAPTER.replace("bridge", "a/b"), "adapters.0.name"),
        (ADAPTER + '[adapters.channels.1]\nkind = "can"', r"adapters.0.channels.1.kind: .*'arinc429' or 'arinc708'"),
        (
            ADAPTER + '[adapters.channels.1]\nkind = "arinc429"\ndefinitions = "gps"',
            "definitions: no definitions 'gps'",
        ),
        (
            ADAPTER + '[adapters.channels.1]\nkind = "arinc429"\ndefinitions = "no.toml"',
            "no.toml cannot be read: No such",
        ),
        (ADAPTER + '[adapters.channels.0]\nkind = "arinc708"\nprofile = "x"', "profile: no profile 'x': use one of"),
        ("radar_profile = 708\n" + ADAPTER, "radar_profile: write a name, or the path of a .toml file$"),
        ('radar_profile = "x"\n' + ADAPTER, "radar_profile: no profile 'x': use one of"),
        (ADAPTER + "[recording]\nsync_interval_s = 0", "recording.sync_interval_s: .*greater than 0"),
        (ADAPTER + "[monitor]\np_fa = 0.7", "monitor.p_fa: .*less than 0.5"),
        (ADAPTER + "[monitor]\nlargest_integrity_limit_nm = 16", "largest_integrity_limit_nm: .*or equal to 15"),
        (ADAPTER + '[monitor]\np_fa = "1e-4"', "monitor.p_fa: Input should be a valid number"),
        (ADAPTER + "[monitor]\nposition_gate = 1", "monitor.position_gate: Input should be a valid boolean"),
        (ADAPTER + "[monitr]\np_fa = 0.1", "monitr: there is no such option"),
        (ADAPTER + ADAPTER, "two adapters are named 'bridge'"),
        ("adapters = [", "is not TOML"),
    ],
)
def test_a_mistake_is_named_with_file_and_key(tmp_path: Path, text: str, where: str) -> None:
    with pytest.raises(GatewayError, match=where) as caught:
        load(tmp_path, text)
    assert str(tmp_path / "rack.toml") in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "key", ["01", '"1.0"', '" 1"', '"+1"', "1_0", "-1", "00", '"\u0661"', '""', "1000", '"1e1"', "0x1"]
)
def test_a_channel_is_one_text_of_plain_digits_and_no_other_that_may_mean_it(tmp_path: Path, key: str) -> None:
    """Two texts of one number would be two tables, of which the second took the place of the first."""
    text = f'{ADAPTER}[adapters.channels.1]\nkind = "arinc708"\n[adapters.channels.{key}]\nkind = "arinc429"\n'
    said = rf"channels\..*\[key\]: {re.escape(repr(key.strip(chr(34))))} is no channel: write plain digits, 0 to 255$"
    with pytest.raises(GatewayError, match=said):
        load(tmp_path, text)


def test_channels_from_0_to_255_are_taken(tmp_path: Path) -> None:
    tables = "".join(f'[adapters.channels.{n}]\nkind = "arinc708"\n' for n in range(256))
    assert list(load(tmp_path, ADAPTER + tables).adapters[0].channels) == list(range(256))
    with pytest.raises(GatewayError, match=r"channels\.256\.\[key\]: .*less than or equal to 255"):
        load(tmp_path, ADAPTER + '[adapters.channels.256]\nkind = "arinc708"')


@pytest.mark.parametrize(
    ("kind", "option"),
    [
        ("arinc708", 'definitions = "iru_704"'),
        ("arinc708", 'orientation = "wire"'),
        ("arinc708", 'join_rule = "toward_zero"'),
        ("arinc708", "sdi = 1"),
        ("arinc708", "delays_ms = { 324 = 20 }"),
        ("arinc429", 'profile = "arinc708"'),
    ],
)
def test_an_option_that_does_nothing_for_a_channel_s_kind_is_refused_by_name(
    tmp_path: Path, kind: str, option: str
) -> None:
    name = option.partition(" ")[0]
    said = rf"rack\.toml: adapters\.0\.channels\.7\.{name}: {kind} has no use for it: leave it out$"
    with pytest.raises(GatewayError, match=said):
        load(tmp_path, f'{ADAPTER}[adapters.channels.7]\nkind = "{kind}"\n{option}')


def test_a_recording_that_holds_such_an_option_is_read_as_ever() -> None:
    channels = {"7": {"kind": "arinc708", "sdi": 1}}
    config = check_config({"adapters": [{"name": "a", "source": "serial:x", "channels": channels}]}, "test")
    assert recorded_config(describe(config, None)) == config


def test_one_mistake_in_an_adapter_is_one_complaint(tmp_path: Path) -> None:
    with pytest.raises(GatewayError) as caught:
        load(tmp_path, ADAPTER + "baud = 10")
    assert ";" not in str(caught.value)


def test_a_rack_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(GatewayError, match=r"cannot read configuration .*none.toml: No such file"):
        load_config(tmp_path / "none.toml")


def test_a_rack_file_that_is_no_text_is_named(tmp_path: Path) -> None:
    (tmp_path / "rack.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(GatewayError, match=r"rack.toml is not TOML"):
        load_config(tmp_path / "rack.toml")


def test_terrain_and_calibration_that_cannot_be_used_are_named_before_anything_opens(tmp_path: Path) -> None:
    adapters = [{"name": "a", "source": "serial:x"}]
    (tmp_path / "radar.json").write_text("sigma = 2")
    nowhere = tmp_path / "nowhere.tif"
    with rasterio.open(
        nowhere, "w", driver="GTiff", height=2, width=2, count=1, dtype="int16", transform=Affine.translation(7, 45)
    ):
        pass
    for table, said in (
        ({"calibration": tmp_path / "radar.json"}, r"calibration file .*radar\.json: the file: Invalid JSON"),
        ({"terrain": [nowhere]}, r"nowhere\.tif has no coordinate reference system: assign one with gdal_edit"),
    ):
        with pytest.raises(GatewayError, match=said):
            build_monitor(check_config({"adapters": adapters, **table}, "test"))


def test_a_configuration_survives_the_recording_that_holds_it() -> None:
    config = check_config(
        {
            "adapters": [{"name": "a", "source": "serial:x", "channels": {"3": {"kind": "arinc708"}}}],
            "terrain": ["/t.hgt"],
            "monitor": {"refraction_k": float("inf"), "p_fa": 1e-3},
        },
        "test",
    )
    assert recorded_config(describe(config, None)) == config


def test_a_path_that_no_recording_could_hold_is_refused_before_it_records() -> None:
    adapters = [{"name": "a", "source": "serial:x"}]
    for table in ({"terrain": ["/maps/z\udcff.hgt"]}, {"recording": {"directory": "/maps/z\udcff.hgt"}}):
        with pytest.raises(GatewayError, match=r"^/maps/z\\xff\.hgt: the name is not UTF-8, .*: rename it"):
            describe(check_config({"adapters": adapters, **table}, "test"), None)
    named = check_config({"adapters": adapters, "terrain": ["/Gelände/é.hgt"]}, "test")
    assert recorded_config(describe(named, None)) == named


OWN_PROFILE = '[my_radar]\nextends = "arinc708"\nscan_angle_zero = "tail"\n'
OWN_SET = """[my_box]
equipment_id = 0x0EE
rows = [ { label = "310", name = "Mine", encoding = "disc", source = "me", confidence = "1 source" } ]
"""
OWN_FILES = f"""radar_profile = "files/radar.toml"
{ADAPTER}
[adapters.channels.0]
kind = "arinc708"
profile = "files/radar.toml"
[adapters.channels.1]
kind = "arinc429"
definitions = "files/labels.toml"
"""


def own_files(tmp_path: Path, profile: str = OWN_PROFILE, labels: str = OWN_SET) -> Path:
    folder = tmp_path / "files"
    folder.mkdir()
    (folder / "radar.toml").write_text(profile)
    (folder / "labels.toml").write_text(labels)
    return folder


def test_profiles_and_definitions_of_ones_own_count_from_the_rack_file_and_are_kept_with_it(tmp_path: Path) -> None:
    folder = own_files(tmp_path)
    config = load(tmp_path, OWN_FILES)
    for file in folder.iterdir():
        file.unlink()
    with_options = check_config({**config.model_dump(), "wait_for_devices": True}, "options")
    restored = recorded_config(describe(with_options, None))
    channels = restored.adapters[0].channels
    assert channels[0].profile == restored.radar_profile == TomlFile(path=folder / "radar.toml", text=OWN_PROFILE)
    link = Link(restored.adapters[0], profile_of(restored.radar_profile))
    assert (link.radar_profile.name, link.radar_profile.scan_angle_zero) == ("my_radar", "tail")
    radar, box = link.channels[0], link.channels[1]
    assert isinstance(radar, Channel708)
    assert isinstance(box, Channel429)
    assert radar.profile == link.radar_profile
    assert (box.definitions.equipment_id, box.definitions.labels[0o310].name) == (0xEE, "Mine")


@pytest.mark.parametrize(
    ("profile", "labels", "where"),
    [
        (
            OWN_PROFILE + "bins = 1",
            OWN_SET,
            r"channels\.0\.profile: .*radar\.toml:4 \[my_radar\] bins: .*multiple of 8",
        ),
        (OWN_PROFILE + "bins = 1", OWN_SET, r"radar_profile: .*radar\.toml:4 \[my_radar\] bins: .*multiple of 8"),
        ("[", OWN_SET, r"radar\.toml is no TOML"),
        (OWN_PROFILE, "[", r"channels\.1\.definitions: .*labels\.toml is no TOML"),
        (OWN_PROFILE, OWN_SET.replace("310", "999"), r"labels\.toml:[0-9]+ \[my_box\] label 999"),
    ],
)
def test_a_mistake_in_a_file_of_ones_own_is_named_with_both_files(
    tmp_path: Path, profile: str, labels: str, where: str
) -> None:
    own_files(tmp_path, profile, labels)
    with pytest.raises(GatewayError, match=where) as caught:
        load(tmp_path, OWN_FILES)
    assert str(tmp_path / "rack.toml") in str(caught.value)


def test_a_profile_file_that_is_not_there_or_no_text_is_named(tmp_path: Path) -> None:
    with pytest.raises(GatewayError, match=r"radar_profile: .*files/radar\.toml cannot be read: No such file"):
        load(tmp_path, OWN_FILES)
    (own_files(tmp_path) / "radar.toml").write_bytes(b"\xff")
    with pytest.raises(GatewayError, match=r"radar_profile: .*files/radar\.toml is no TOML"):
        load(tmp_path, OWN_FILES)


def test_sizes_of_shadows_that_exclude_each_other_are_refused() -> None:
    sizes = {"minimum_size": 10, "maximum_size": 5}
    with pytest.raises(GatewayError, match="maximum_size 5 is below minimum_size 10"):
        check_config({"adapters": [{"name": "a", "source": "serial:x"}], "monitor": sizes}, "test")


@pytest.mark.parametrize("bits", ["[26, 28]", "[22, 28]", "28"])
def test_a_mode_of_the_receiver_that_would_be_misread_is_refused(bits: str, tmp_path: Path) -> None:
    row = f"label = '273', name = 'n', encoding = 'disc', fields = {{ mode = {bits} }}, source = 's', confidence = 'c'"
    (tmp_path / "own.toml").write_text(f"[own]\nequipment_id = 0x00B\nextends = 'gnss_743a'\nrows = [{{ {row} }}]")
    text = ADAPTER + '[adapters.channels.1]\nkind = "arinc429"\ndefinitions = "own.toml"'
    with pytest.raises(GatewayError, match=r"definitions: \[own\] label 273: mode has . bits: give it all 5"):
        load(tmp_path, text)
