"""Files that commands write, each in the format that its name says."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click


class WrittenFile(click.Path):
    """A path to be written; a name that ends as another format's files do is refused, before any work.

    >>> table = WrittenFile(".json", "JSON")
    >>> str(table.convert("errors.json", None, None))
    'errors.json'
    >>> table.convert("errors.csv", None, None)
    Traceback (most recent call last):
        ...
    click.exceptions.BadParameter: errors.csv: this is written as JSON, so give it a name that ends in .json
    """

    def __init__(self, suffix: str, written_as: str) -> None:
        super().__init__(path_type=Path)
        self._suffix, self._written_as = suffix, written_as

    def convert(self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path, if its name has the format's suffix or none."""
        path = Path(str(super().convert(value, param, ctx)))
        if path.suffix.lower() not in ("", self._suffix):
            told = f"this is written as {self._written_as}, so give it a name that ends in {self._suffix}"
            self.fail(f"{path}: {told}", param, ctx)
        return path
