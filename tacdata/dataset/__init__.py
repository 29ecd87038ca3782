"""Datasets: LeRobot v3.0 folders written and read by pyarrow, with units, sensor and provenance kept.

Importing this package imports neither torch nor lerobot; `tacdata.dataset.windows` needs torch.
"""

from tacdata.dataset.pack import Packed, pack
from tacdata.dataset.reader import Dataset, DatasetEpisode, LostProvenanceWarning, read_dataset
from tacdata.dataset.restore import restore
from tacdata.dataset.writer import DatasetWriter

__all__ = [
    "Dataset",
    "DatasetEpisode",
    "DatasetWriter",
    "LostProvenanceWarning",
    "Packed",
    "pack",
    "read_dataset",
    "restore",
]
