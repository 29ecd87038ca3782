"""What follows from a controller's answers."""

import numpy as np
import pytest

from tacdata.errors import DeviceError
from tacdata.wire.grbl.settings import GrblSettings

TRAVEL = {"$20": "1", "$22": "1", "$23": "0", "$130": "200.000", "$131": "150.000", "$132": "60.000", "$1": "255"}


def test_receive_buffer():
    assert GrblSettings({"OPT": "V,15,128"}).rx_bytes == 128
    assert GrblSettings({"OPT": "VNMSL,100,1024,3,0"}).rx_bytes == 1024
    assert GrblSettings({"OPT": "V"}).rx_bytes is None


def test_travel_is_negative_unless_the_origin_is_at_the_switch():
    lower, upper = GrblSettings({**TRAVEL, "OPT": "V,15,128"}).travel
    np.testing.assert_array_equal(lower, [-200, -150, -60])
    np.testing.assert_array_equal(upper, 0)
    for said in ({"OPT": "VZ,15,128", "$23": "3"}, {"FIRMWARE": "grblHAL", "$22": "9", "$23": "3"}):
        lower, upper = GrblSettings({**TRAVEL, **said}).travel
        np.testing.assert_array_equal(lower, [0, 0, -60])
        np.testing.assert_array_equal(upper, [200, 150, 0])
    assert GrblSettings({**TRAVEL, "FIRMWARE": "grblHAL", "OPT": "VZ,100,1024", "$22": "1"}).travel[1].max() == 0


@pytest.mark.parametrize("missing", [{"$20": "0"}, {"$132": "0"}])
def test_no_travel_without_soft_limits(missing):
    assert GrblSettings({**TRAVEL, **missing}).travel is None


def test_work_offset_is_the_sum_of_what_is_active():
    said = {"GC": "G1 G55 G17 G21 G90 G94 M5 M9 T0 F0 S0", "G54": "9,9,9", "G55": "1,2,3", "G92": "10,0,0"}
    np.testing.assert_array_equal(GrblSettings({**said, "TLO": "0.5"}).work_offset, [11, 2, 3.5])
    np.testing.assert_array_equal(GrblSettings({**said, "TLO": "1,1,1"}).work_offset, [12, 3, 4])
    second = {**said, "GC": "G0 G59.1 G17", "G59.1": "7,7,7"}
    np.testing.assert_array_equal(GrblSettings({**second, "TLO": "0"}).work_offset, [17, 7, 7])
    assert GrblSettings({}).work_offset is None


@pytest.mark.parametrize(
    ("said", "bent"),
    [
        ("G0 G54 G17 G21 G90 G94 G49 G98 G50 M5 M9 T0 F0 S0.", ()),
        ("G0 G54 G17 G21 G90 G94 G49 G98 G51:XZ M5 M9 T0 F0 S0.", ("G51",)),
        (
            "G0 G54 G92 G7 G17 G20 G91 G93 G43.2 G98 G50 M3 M8 M53 T0 F0 S500.",
            ("G92", "G7", "G20", "G91", "G93", "G43.2", "M3", "M53"),
        ),
    ],
)
def test_what_bends_moves_or_lets_them_go_on_is_read_as_grblhal_writes_it(said, bent):
    assert GrblSettings({"GC": said}).bent_by == bent


def test_homing_is_one_bit_of_several():
    assert GrblSettings({"$22": "7"}).homing
    assert not GrblSettings({"$22": "6"}).homing


def test_cautions():
    assert GrblSettings(TRAVEL).cautions == ()
    said = " ".join(GrblSettings({"$1": "25", "$20": "0", "$22": "0"}).cautions)
    for word in ("soft limits are off", "homing is off", "switched off 25 ms"):
        assert word in said


@pytest.mark.parametrize(("line", "moves"), [("G54 G21", False), ("", False), ("G0Z-5", True), ("g91x1f10", True)])
def test_startup_lines_that_move_are_refused(line, moves):
    settings = GrblSettings({"$N0": "", "$N1": line})
    if moves:
        with pytest.raises(DeviceError, match=r"at every reset \(\$N1\)"):
            settings.refuse_moves_at_start("/dev/x")
    else:
        settings.refuse_moves_at_start("/dev/x")


def test_unusable_limits_name_the_settings():
    with pytest.raises(DeviceError, match=r"\$120 to \$122"):
        GrblSettings({"$120": "0", "$121": "10", "$122": "10"}).limits("$12", 1.0, "/dev/x")


def test_settings_of_memory_that_was_never_written_are_refused():
    damaged = {f"$11{axis}": "2147483.648" for axis in range(3)}
    with pytest.raises(DeviceError, match=r"states \$110 to \$112 as 2\.14748e\+06, .*") as raised:
        GrblSettings(damaged).limits("$11", 60.0, "/dev/ttyUSB0")
    assert "damaged" in raised.value.allowed
    assert GrblSettings({f"$11{axis}": "60000" for axis in range(3)}).limits("$11", 60.0, "x").max() == 1000.0
