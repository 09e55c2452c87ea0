"""Scenario files: what is refused, and with what words."""

from pathlib import Path

import pytest

from simulators import scenario

MINIMAL = """
seed = 5
[flight]
latitude_deg = 44.4
longitude_deg = -71.7
height_m = 900
heading_deg = 10
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "rack.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_minimal_file_takes_every_other_value_from_the_reference(tmp_path: Path) -> None:
    loaded = scenario.load(write(tmp_path, MINIMAL))
    assert loaded.radar == scenario.white_mountains().radar
    assert loaded.world.path.name == "N44W072.hgt"
    assert loaded.seed == 5


def test_a_terrain_path_counts_from_the_file(tmp_path: Path) -> None:
    loaded = scenario.load(write(tmp_path, MINIMAL + '[world]\nterrain = "dem/tile.tif"\n'))
    assert loaded.world.path == tmp_path / "dem" / "tile.tif"


def test_faults_and_further_legs_are_lists_of_tables(tmp_path: Path) -> None:
    more = '[[flight.legs]]\nheading_deg = 90\nduration_s = 30\n[[faults]]\nname = "gnss_offset"\neast_m = 500\n'
    loaded = scenario.load(write(tmp_path, MINIMAL + more))
    assert loaded.flight.total_s == 150
    assert loaded.faults[0].east_m == 500


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[flight", "rack.toml"),
        (MINIMAL + "[radar]\ntilt = -2\n", "radar.tilt"),
        (MINIMAL + "[radar]\nrange_nm = 12\n", "radar.range_nm"),
        (MINIMAL + '[[faults]]\nname = "flat_tyre"\n', "gnss_no_computed_data"),
        (MINIMAL + '[[faults]]\nname = "radar_silent"\nstart_s = 5\nstop_s = 4\n', "set stop_s after start_s"),
        ("seed = 1\n", "flight"),
    ],
)
def test_a_wrong_file_is_refused_naming_file_and_key(tmp_path: Path, text: str, named: str) -> None:
    with pytest.raises(ValueError, match=r"rack\.toml") as error:
        scenario.load(write(tmp_path, text))
    assert named in str(error.value)


def test_link_faults_are_a_list_of_tables(tmp_path: Path) -> None:
    more = '[[link_faults]]\nname = "lost"\nchance = 0.1\n[[link_faults]]\nname = "unplug"\nstart_s = 5\nstop_s = 6\n'
    loaded = scenario.load(write(tmp_path, MINIMAL + more))
    assert [fault.name for fault in loaded.link_faults] == ["lost", "unplug"]


@pytest.mark.parametrize(
    ("table", "named"),
    [
        ('name = "flat_tyre"', "word_length_errors"),
        ('name = "cut"\nchance = 0.5', "link fault cut takes no chance"),
        ('name = "lost"\nclock_s = 0.5', "link fault lost takes no clock_s"),
        ('name = "lost"\nchance = 2', "chance"),
        ('name = "cut"\nstart_s = 5\nstop_s = 5', "set stop_s after start_s"),
    ],
)
def test_a_wrong_link_fault_is_refused_naming_what_it_takes(tmp_path: Path, table: str, named: str) -> None:
    with pytest.raises(ValueError, match=r"rack\.toml") as error:
        scenario.load(write(tmp_path, f"{MINIMAL}[[link_faults]]\n{table}\n"))
    assert named in str(error.value)


def test_the_example_with_a_broken_link_loads() -> None:
    loaded = scenario.load(Path(__file__).parents[2] / "examples" / "broken_link.toml")
    assert {fault.name for fault in loaded.link_faults} >= {"unplug", "fifo_overflow", "bit_flips"}
    assert loaded.world.path.exists()
