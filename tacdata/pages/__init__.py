"""Pages: one file of HTML with words, tables and figures, which opens without a network."""

from tacdata.pages.blocks import Commands, Items, Paragraph, Picture, Prose, Shares, Tiles
from tacdata.pages.page import HtmlPage, PageHeader, Section, live_page
from tacdata.pages.pixel_map import PixelMap
from tacdata.pages.plot import Band, Plot, Series, Slider
from tacdata.pages.table import Cell, Table

__all__ = [
    "Band",
    "Cell",
    "Commands",
    "HtmlPage",
    "Items",
    "PageHeader",
    "Paragraph",
    "Picture",
    "PixelMap",
    "Plot",
    "Prose",
    "Section",
    "Series",
    "Shares",
    "Slider",
    "Table",
    "Tiles",
    "live_page",
]
