"""Labels: the simulated maps and forces of a press, frame by frame, with their provenance."""

from tacdata.labels.label import Label, PathSolution
from tacdata.labels.table import map_batches
from tacdata.labels.table import read as read_label
from tacdata.labels.table import read_columns as read_label_columns
from tacdata.labels.table import write as write_label

__all__ = ["Label", "PathSolution", "map_batches", "read_label", "read_label_columns", "write_label"]
