"""Every driver keeps the promises of its base class, as far as they can be tried without a device."""

import inspect

import pytest

from tacdata import registry
from tacdata.clock import Clock
from tacdata.devices.device import BASE, ROOM, Camera, Device, MotionController, TaxelBoard, create
from tacdata.errors import DeviceError, UsageError

NAMES = registry.names(ROOM, BASE)
KINDS = (TaxelBoard, MotionController, Camera)
NOWHERE = "/nowhere/at all"
INTRINSICS = {"width": 8, "height": 8, "fx": 9.0, "fy": 9.0, "cx": 4.0, "cy": 4.0}


def settings(driver):
    """Return settings under which a driver finds no device."""
    signature = inspect.signature(registry.load(ROOM, BASE, driver, Device))
    needed = [p.name for p in signature.parameters.values() if p.default is p.empty and p.name != "clock"]
    given = {"port": NOWHERE, "source": NOWHERE, "intrinsics": INTRINSICS}
    return {"driver": driver, **{name: given.get(name, 0) for name in needed}}


def made(driver):
    """Return a driver that is not open."""
    return create(settings(driver), Device, Clock.start())


@pytest.mark.parametrize("driver", NAMES)
def test_a_driver_is_of_one_kind(driver):
    assert sum(issubclass(registry.load(ROOM, BASE, driver, Device), kind) for kind in KINDS) == 1


@pytest.mark.parametrize("driver", NAMES)
def test_a_driver_describes_itself_before_it_is_opened(driver):
    described = made(driver).describe()
    assert described["driver"] == driver
    assert described["kind"]


@pytest.mark.parametrize("driver", NAMES)
def test_a_device_that_is_not_there_is_refused_in_words(driver):
    device = made(driver)
    with pytest.raises(DeviceError) as caught:
        device.open()
    assert caught.value.allowed
    assert caught.value.remedy


@pytest.mark.parametrize("driver", NAMES)
def test_closing_never_raises_and_may_come_twice(driver):
    device = made(driver)
    device.close()
    device.close()


@pytest.mark.parametrize("driver", NAMES)
def test_a_setting_that_is_unknown_or_missing_is_named(driver):
    with pytest.raises(UsageError, match="setting colour"):
        create({**settings(driver), "colour": "red"}, Device, Clock.start())
    for name in settings(driver).keys() - {"driver"}:
        with pytest.raises(UsageError, match=f"without {name}"):
            create({k: v for k, v in settings(driver).items() if k != name}, Device, Clock.start())


@pytest.mark.parametrize("driver", NAMES)
def test_every_setting_is_explained(driver):
    kind = registry.load(ROOM, BASE, driver, Device)
    text = inspect.getdoc(kind)
    assert not [name for name in inspect.signature(kind).parameters if name != "clock" and f"``{name}``" not in text]
