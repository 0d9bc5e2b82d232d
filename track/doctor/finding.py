"""What was looked at, how it is, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

State = Literal["ok", "missing", "not here", "bad"]
"""``bad``: nothing runs without it. ``missing``: a part does not. ``not here``: it cannot be had on this machine."""


@dataclass(frozen=True)
class Finding:
    """One line of what was found: what it is about and how it is, and if it is not well, what to do."""

    state: State
    told: str
    remedy: str = ""

    def line(self) -> str:
        """The line as people read it.

        >>> Finding("missing", "viser", "pip install 'bonetrack[view]'").line()
        "  missing   viser; pip install 'bonetrack[view]'"
        """
        return f"  {self.state:<9} {self.told}" + (f"; {self.remedy}" if self.remedy else "")
