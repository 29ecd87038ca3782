"""A sensor from above: the skin, its taxels by number, and the area of depth maps."""

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from tacdata.sensor import Sensor
from tacdata.viewers.portraits import portrait as parts


def portrait(noun: Sensor) -> Figure:
    """Draw the sensor in its own frame."""
    figure = parts.figure(width=5.5)
    axes = figure.subplots()
    grid, skin = noun.map, noun.skin
    width, height = grid.pixels_x * grid.pixel_pitch, grid.pixels_y * grid.pixel_pitch
    axes.add_patch(Rectangle((-skin.size_x / 2, -skin.size_y / 2), skin.size_x, skin.size_y, fc="0.93", ec="0.5"))
    axes.add_patch(Rectangle((-width / 2, -height / 2), width, height, fc="none", ec="C0", ls="--", label="depth map"))
    for number, (x, y) in enumerate(noun.taxels.centers):
        axes.text(x, y, str(number), ha="center", va="center", fontsize=7, bbox={"facecolor": "white", "pad": 2})
    axes.autoscale_view()
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    axes.set_title(f"{noun.name}, from above", loc="left")
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1), fontsize=7, frameon=False)
    return figure
