"""Tables of files that were read before: a changed role reads no file again."""

from tacdata.importing.source_files import FileSet
from tacdata.importing.source_table import SourceTable


class TableMemory:
    """The latest tables, by file and by how it is read."""

    def __init__(self, capacity: int = 16) -> None:
        """Keep at most ``capacity`` tables."""
        self.capacity = capacity
        self._tables: dict[str, SourceTable] = {}

    def tables(self, files: FileSet) -> dict[str, SourceTable]:
        """Return the rows of every file of a set; raises FormatError if one cannot be read."""
        read = {}
        for name, file in files.files.items():
            key = repr((file.paths, [path.stat().st_mtime_ns for path in file.paths], file.entry))
            table = self._tables.pop(key, None)
            read[name] = self._tables[key] = table or file.read(f"files: {name}: derived")
            while len(self._tables) > self.capacity:
                del self._tables[next(iter(self._tables))]
        return read
