"""Label sets are checked when they are read, and a refusal names the file, the set and the label."""

import re
import sys
from fractions import Fraction
from pathlib import Path
from subprocess import run

import pytest

from decoders.definitions import DefinitionError, for_equipment, load_definitions, parse_definitions

BASE = "name = 'n', source = 's', confidence = 'c'"
COARSE = "encoding = 'bnr', units = 'deg'"
FINE = "encoding = 'bnr_unsigned', units = 'deg', range = '180/2^20'"
ANGLE = "encoding = 'bnr', bits = [14, 28], range = 180, lsb = '180/2^15', units = 'deg'"


def file_of(folder: Path, *rows: str, head: str = "equipment_id = 1") -> Path:
    file = folder / "mine.toml"
    file.write_text(f"[mine]\n{head}\nrows = [{', '.join(f'{{ {BASE}, {row} }}' for row in rows)}]", "utf-8")
    return file


def test_a_file_of_the_users_is_a_set(tmp_path: Path) -> None:
    definitions = load_definitions(
        file_of(tmp_path, f"label = '314', {ANGLE}, fields = {{ low = 11, pair = [12, 13] }}")
    )
    row = definitions.labels[0o314]
    assert (definitions.name, definitions.equipment_id) == ("mine", 1)
    assert (row.lsb, row.range, row.ssm, row.has_sdi) == (Fraction(180, 2**15), Fraction(180), "bnr", True)
    assert row.fields == {"low": (11, 11), "pair": (12, 13)}


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        (f"label = '314', {ANGLE}, fields = {{ a = [11, 14] }}", "bit 14 of a overlaps the value"),
        (f"label = '314', {ANGLE}, fields = {{ a = 29 }}", "bit 29 of a overlaps the sign"),
        (f"label = '314', {ANGLE}, fields = {{ a = [11, 12], b = 12 }}", "bit 12 of b overlaps a"),
        ("label = '314', encoding = 'disc', fields = { a = [11, 12], b = 12 }", "bit 12 of b overlaps a"),
        (f"label = '314', {ANGLE.replace('2^15', '2^14')}", r"the LSB is not range / 2\^15"),
        (f"label = '314', {ANGLE}, colour = 'red'", "colour"),
        ("label = '314', encoding = 'bnr', bits = [14, 28], range = 180, units = 'deg'", "needs lsb"),
        ("label = '314', encoding = 'bnr2'", "unknown encoding 'bnr2'"),
        ("label = '314', encoding = 'time', bits = [12, 28]", "bits"),
        (f"label = '314', {ANGLE}, ssm = 'odd'", "unknown ssm 'odd'"),
        (f"label = '314', {ANGLE}, fields = 7", "fields is 7, which is no table"),
        (f"label = '314', {ANGLE}, fields = {{ a = [11, 12, 13] }}", "give a bit, or the first and the last"),
        (f"label = '314', {ANGLE}, interval_ms = true", "interval_ms is True"),
        (f"label = '314', {ANGLE}, positive = 5", "positive is 5, which is no text"),
        (f"label = '314', {ANGLE.replace('[14, 28]', '[14.0, 28.0]')}", "give a bit, or the first and the last"),
        ("label = '314', encoding = ['bnr']", "encoding is .'bnr'., which is no text"),
        (f"label = '400', {ANGLE}", "octal, '000' to '377'"),
        (f"label = '389', {ANGLE}", "'389' is no label"),
        (f"label = 314, {ANGLE}", "label 314"),
        (f"label = '314', {ANGLE.replace('28', '27').replace('^15', '^14')}", "bits end at 28"),
        ("label = '314', encoding = 'disc', bits = [8, 12]", "bits 8 to 12"),
        ("label = '314', encoding = 'disc', bits = [12, 30]", "bits 12 to 30"),
        ("label = '314', encoding = 'disc', bits = [13, 12]", "bits 13 to 12"),
        ("label = '314', encoding = 'bcd', bits = [11, 29], lsb = 0, units = ''", "not positive"),
        ("label = '314', bits = [11, 29]", "a row needs encoding"),
        (f"label = '314', {ANGLE}, interval_ms = [1, 2, 3]", r"interval_ms is \[1, 2, 3\]: give the shortest"),
        (f"label = '314', {ANGLE}, interval_ms = ['1', '2']", r"interval_ms is \['1', '2'\]: give the shortest"),
        (f"label = '314', {ANGLE}, interval_ms = []", r"interval_ms is \[\]: give the shortest"),
        (f"label = '314', {ANGLE}, interval_ms = [50, 25]", "the longest is above the shortest"),
        (f"label = '314', {ANGLE.replace('180/2^15', '1/0')}", "lsb is '1/0': write a number, such as 0.125 or"),
        (f"label = '314', {ANGLE.replace('2^15', '2^0.5')}", r"lsb is '180/2\^0.5': write a number"),
        (f"label = '314', {ANGLE.replace('range = 180', 'range = nan')}", "range is nan, which is no number"),
        ("label = '314', encoding = 'bcd', bits = [11, 29], lsb = '1/2^54', units = ''", "too fine"),
    ],
)
def test_a_row_that_contradicts_itself_is_refused(row: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(DefinitionError, match=reason) as caught:
        load_definitions(file_of(tmp_path, row))
    assert f"{tmp_path / 'mine.toml'}:3 [mine] label " in str(caught.value)


def test_a_label_twice_in_one_set_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DefinitionError, match=r"mine.toml:3 \[mine\] label 014: defined twice"):
        load_definitions(file_of(tmp_path, f"label = '14', {ANGLE}", f"label = '014', {ANGLE}"))


ROW = f"{{ {BASE}, label = '310', encoding = 'disc' }}"
BAD = f"{{ {BASE}, label = '314', encoding = 'bad' }}"


@pytest.mark.parametrize(
    ("rows", "line"),
    [
        (f"rows = [\n{BAD}]", 4),
        (f"rows = [\n  {ROW},\n  {BAD},\n]", 5),
        (f"rows = [\n# {BAD}\n{ROW}, # label = '314' {{\n{BAD}]", 6),
        (f"rows = [{ROW.replace(chr(39) + 'n' + chr(39), chr(39) + 'label = 314 [{' + chr(39))},\n{BAD}]", 4),
        (f"rows = [\n{{ {BASE}, encoding = 'disc' }}]", 4),
        ("[[mine.rows]]\nname = 'n'\n[[mine.rows]]\nlabel = '314'", 4),
        (
            f"rows = [\n{{ {BASE.replace(chr(39) + 's' + chr(39), chr(39) * 3 + '{' + chr(10) + chr(39) * 3)},\
 label = '310', encoding = 'disc' }}, # [\n{BAD}]",
            6,
        ),
    ],
)
def test_the_line_is_that_of_the_row(rows: str, line: int, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(f"[mine]\nequipment_id = 1\n{rows}")
    with pytest.raises(DefinitionError, match=rf"mine.toml:{line} \[mine\] label"):
        load_definitions(tmp_path / "mine.toml")


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (f"['my iru'] # c\nequipment_id = 1\nrows = [\n{ROW},\n{BAD}]", "5 [my iru] label 314"),
        (f"my.equipment_id = 1\nmy.rows = [{ROW},\n{BAD}]", "3 [my] label 314"),
        (f"my = {{ equipment_id = 1, rows = [\n{ROW},\n{BAD}] }}", "3 [my] label 314"),
        (f"[my]\r\nequipment_id = 1\r\nrows = [\r\n{ROW},\r\n{BAD}]", "5 [my] label 314"),
        ("[my]\nequipment_id = 1\nrows = [\n{},\n]", "4 [my] label ?"),
        ("[my]\nrows = []\n\nequipment_id = true", "4 [my]"),
        ("[my]\n# c\nrows = []\n", "3 [my]"),
    ],
)
def test_the_line_is_known_in_every_form_of_toml(text: str, place: str, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_bytes(text.encode())
    with pytest.raises(DefinitionError, match=rf"mine.toml:{re.escape(place)}: "):
        load_definitions(tmp_path / "mine.toml")


@pytest.mark.parametrize("base", ["'nothing'", "['iru_704']", "7", "'/tmp/mine.toml'"])
def test_a_set_that_extends_what_there_is_not_names_those_there_are(base: str, tmp_path: Path) -> None:
    with pytest.raises(
        DefinitionError, match=r"mine.toml:3 \[mine\]: extends is .*: name one of gnss_743a, "
    ) as caught:
        load_definitions(file_of(tmp_path, f"label = '314', {ANGLE}", head=f"equipment_id = 1\nextends = {base}"))
    assert "or a .toml" not in str(caught.value)


def test_a_remainder_is_refused_with_the_line_of_the_row_that_broke_it(tmp_path: Path) -> None:
    """The remainder itself, or the row that took the place of its inherited coarse word."""
    own = "label = '056', encoding = 'bnr_unsigned', bits = [18, 28], range = 1, lsb = '1/2^11', units = 'm'"
    coarse = "label = '061', encoding = 'bnr', bits = [10, 28], range = 268435456, lsb = 512, units = 'm'"
    head = "equipment_id = 11\nextends = 'gnss_743a'"
    for row, label in ((own + ", fine_of = '061'", "056"), (coarse, "062")):
        with pytest.raises(DefinitionError, match=rf"mine.toml:4 \[mine\] label {label}: no remainder of label 061"):
            load_definitions(file_of(tmp_path, row, head=head))
        load_definitions.cache_clear()


@pytest.mark.parametrize(
    ("row", "why"),
    [
        (f"'110', {COARSE}, bits = [11, 28], range = 180, lsb = '180/2^18'", "joined from bits 9 to 28"),
        (f"'111', {COARSE}, bits = [9, 28], range = 90, lsb = '90/2^20'", "joined from bits 9 to 28"),
        (f"'120', {FINE}, bits = [17, 28], lsb = '180/2^32', fine_of = '110'", "joined from bits 18 to 28"),
        (f"'121', {FINE}, bits = [18, 28], lsb = '180/2^31', fine_of = '110'", "fine_of 111"),
        (f"'121', {FINE}, bits = [18, 28], lsb = '180/2^31'", "fine_of 111"),
    ],
)
def test_a_position_word_that_would_not_be_read_as_it_is_defined_is_refused(row: str, why: str, tmp_path: Path) -> None:
    """With the rest of the set inherited, or all by itself."""
    for base in ("\nextends = 'gnss_743a'", ""):
        file = file_of(tmp_path, f"label = {row}", head=f"equipment_id = 0x00B{base}")
        with pytest.raises(DefinitionError, match=rf"mine.toml:{3 + bool(base)} \[mine\] label 1.*{why}"):
            load_definitions(file)
        load_definitions.cache_clear()


def test_a_set_that_extends_another_replaces_labels_and_keeps_the_rest(tmp_path: Path) -> None:
    head = "equipment_id = 4\nextends = 'iru_704'"
    wide = ANGLE.replace("14, 28", "11, 28").replace("^15", "^18")
    mine = load_definitions(file_of(tmp_path, f"label = '314', {wide}", head=head))
    assert mine.labels[0o314].bits == (11, 28)
    assert mine.labels[0o310] == load_definitions("iru_704").labels[0o310]
    assert load_definitions("iru_704").labels[0o314].bits == (14, 28)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[a]\nequipment_id = 1\nrows = []\n[b]\nequipment_id = 1\nrows = []", "2 sets"),
        ("", "0 sets"),
        ("[a]\nrows = []", "a set has equipment_id"),
        ("[a]\nequipment_id = 1\nrows = []\nrowz = []", "a set has equipment_id"),
        ("[a]\nequipment_id = 1\nrows = [7]", "7 is no row"),
        ("[a]\nequipment_id = 1\nrows = []", "at least one row"),
        ("[a]\nequipment_id = 1\nrows = [{ lsb = inf }]", "lsb is inf, which is no number"),
        ("a = ", "is no TOML"),
        ("[a]\nequipment_id = '0x0B'\nrows = []", "equipment_id is a number"),
        ("[a]\nequipment_id = -5\nrows = []", "equipment_id is a number"),
        ("[a]\nequipment_id = 11\nrows = 5", "rows is a list"),
    ],
)
def test_a_file_that_is_not_one_set_is_refused(text: str, reason: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text, "utf-8")
    with pytest.raises(DefinitionError, match=reason) as caught:
        load_definitions(file)
    assert "mine.toml" in str(caught.value)


def test_an_unknown_name_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ValueError, match=r"'iru_705'.*iru_704"):
        load_definitions("iru_705")
    with pytest.raises(FileNotFoundError):
        load_definitions("/nowhere/labels.toml")


@pytest.mark.parametrize(
    ("equipment_id", "name"),
    [(0x0B, "gnss_743a"), (0x04, "iru_704"), (0x06, "adc_706"), (0x07, "ra_707"), (0x99, None)],
)
def test_equipment_is_looked_up_by_the_low_byte_of_its_id(equipment_id: int, name: str | None) -> None:
    assert for_equipment(equipment_id) == name
    assert name is None or load_definitions(name).equipment_id == equipment_id


@pytest.mark.parametrize(
    ("name", "twenty_bit"),
    [
        ("gnss_743", {0o061, 0o063, 0o064, 0o065, 0o070, 0o072, 0o074, 0o076, 0o110, 0o111, 0o140, 0o370}),
        ("adiru_738", {0o254, 0o255, 0o261, 0o265, 0o310, 0o311, 0o361}),
        ("adc_706", set()),
    ],
)
def test_bits_9_and_10_are_data_in_the_20_bit_words_and_in_no_other(name: str, twenty_bit: set[int]) -> None:
    labels = load_definitions(name).labels
    assert {label for label, row in labels.items() if not row.has_sdi} == twenty_bit


def test_a_field_at_bits_9_or_10_makes_them_data(tmp_path: Path) -> None:
    for bit, has_sdi in ((9, False), (10, False), (11, True)):
        text = (
            f"[a]\nequipment_id = 1\nrows = [{{ {BASE}, label = '270', encoding = 'disc', fields = {{ x = {bit} }} }}]"
        )
        assert parse_definitions(text, tmp_path).labels[0o270].has_sdi is has_sdi


def test_the_label_table_is_read_without_numba() -> None:
    code = "import decoders.definitions as d, sys; d.load_definitions('iru_704'); sys.exit('numba' in sys.modules)"
    assert run([sys.executable, "-c", code], check=False).returncode == 0
