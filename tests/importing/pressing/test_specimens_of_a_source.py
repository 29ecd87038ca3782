"""A column or a path says which specimen was pressed: the verdict gives each a response of its own."""

import numpy as np
import pytest
import yaml
from foreign import mapping

from tacdata.discrepancy.data.recordings import course_of
from tacdata.errors import FormatError
from tacdata.importing.imported_session import import_session
from tacdata.importing.proposing.description import described
from tacdata.importing.proposing.proposal import proposed_mapping

MATERIALS = ("eco30", "ds10", "eco30", "ds10")
KNOTS = np.cumsum([0.0, 0.5, 1.0, 0.5, 1.0, 0.5])
TIME = np.arange(0, KNOTS[-1], 0.05)
DEPTH = np.interp(TIME, KNOTS, [-0.2, -0.2, 1.0, 1.0, -0.2, -0.2])


def rows(number, material):
    """Two materials that are hardly apart."""
    stiff = 10.0 if material == "eco30" else 10.5
    return [
        f"{number},{material},{t + 6 * number:.3f},{d:.4f},{20 + stiff * max(d, 0):.4f}"
        for t, d in zip(TIME, DEPTH, strict=True)
    ]


def in_a_column(folder, **changes):
    lines = ["run,material,t,disp,cap0"]
    for number, material in enumerate(MATERIALS):
        lines += rows(number, material)
    (folder / "wide.csv").write_text("\n".join(lines) + "\n")
    return mapping(
        folder,
        measured=None,
        trials={"column": "run"},
        files={"data": {"path": "wide.csv", "time": {"column": "t"}}},
        position={"file": "data", "depth": {"column": "disp", "unit": "mm"}},
        **changes,
    )


def test_each_specimen_of_a_column_has_a_place_of_its_own(tmp_path):
    path = in_a_column(tmp_path, press={"specimen": {"column": "material"}})
    course = course_of([import_session(tmp_path, path, tmp_path / "session").folder])
    assert course.site[0] == course.site[2] != course.site[1] == course.site[3]
    assert any("2 specimens by the source" in words for words in course.notes)
    plain = course_of([import_session(tmp_path, in_a_column(tmp_path), tmp_path / "plain").folder])
    assert len(set(plain.site)) == 1


@pytest.mark.parametrize("trials", [{"gap": 0.5}, {"column": "again"}, {"press_above": 0.1}])
@pytest.mark.parametrize("once", [False, True])
def test_a_recording_holds_one_specimen_however_trials_are_cut(tmp_path, trials, once):
    """Runs are counted anew for each material, and some write its name into the first row of a block only."""
    lines = ["again,run,material,t,disp,cap0"]
    for number, material in enumerate(("eco30", "eco30", "ds10", "ds10")):
        block = [f"{number % 2},{line}" for line in rows(number, material)]
        lines += [block[0], *(line.replace(material, "") if once else line for line in block[1:])]
    (tmp_path / "wide.csv").write_text("\n".join(lines) + "\n")
    path = mapping(
        tmp_path,
        measured=None,
        trials=trials,
        files={"data": {"path": "wide.csv", "time": {"column": "t"}}},
        position={"file": "data", "depth": {"column": "disp", "unit": "mm"}},
        press={"specimen": {"column": "material"}},
    )
    made = import_session(tmp_path, path, tmp_path / "session")
    course = course_of([made.folder])
    assert made.recordings == 4 and sorted(np.bincount(course.site)) == [2, 2]
    assert any("2 specimens by the source" in words for words in course.notes)


def test_a_path_says_it_too(tmp_path):
    for number, material in enumerate(MATERIALS):
        lines = ["run,material,t,disp,cap0", *rows(number, material)]
        (tmp_path / f"spec{material}_cyc{number}.csv").write_text("\n".join(lines) + "\n")
    entry = {"part": "who", "pattern": "spec([a-z]+)"}
    clock = {"path": "{who}_cyc{k}.csv", "time": {"column": "t", "zero": "shared"}}
    path = mapping(
        tmp_path,
        measured=None,
        files={"data": clock},
        press={"specimen": entry},
        position={"file": "data", "depth": {"column": "disp", "unit": "mm"}},
    )
    course = course_of([import_session(tmp_path, path, tmp_path / "session").folder])
    assert sorted(np.bincount(course.site)) == [2, 2]


def test_what_says_nothing_is_refused_in_words(tmp_path):
    for entry, words in (({"part": "who"}, "no path has"), ({"column": "absent"}, "absent")):
        with pytest.raises(FormatError) as caught:
            import_session(tmp_path, in_a_column(tmp_path, press={"specimen": entry}), tmp_path / "session")
        assert words in f"{caught.value.given} {caught.value.allowed}"


def test_a_proposal_finds_the_column_and_the_path(tmp_path):
    in_a_column(tmp_path)
    (tmp_path / "mapping.yaml").unlink()
    tables, _ = described(tmp_path)
    found = proposed_mapping(tmp_path, tables).document
    assert found["press"] == {"specimen": {"file": "wide", "column": "material"}}
    assert found["taxels"]["columns"] == ["cap0"]
    (tmp_path / "mapping.yaml").write_text(yaml.safe_dump(found))
    assert import_session(tmp_path, tmp_path / "mapping.yaml", tmp_path / "session").recordings == len(MATERIALS)
    named = tmp_path / "named"
    named.mkdir()
    for number in (1, 2):
        lines = ["t,disp,cap0", *(row.split(",", 2)[2] for row in rows(0, "eco30"))]
        (named / f"spec{number}_cyc{number}.csv").write_text("\n".join(lines) + "\n")
    tables, _ = described(named)
    assert proposed_mapping(named, tables).document["press"] == {"specimen": {"part": "part0"}}
