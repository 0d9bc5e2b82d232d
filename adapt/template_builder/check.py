"""A check of a template: a number, a limit and a verdict."""

from __future__ import annotations

from dataclasses import dataclass

from capture.errors import AnatomyError


@dataclass(frozen=True)
class Check:
    """One finding: ``measured`` must not exceed ``limit`` (``least``: must not fall below)."""

    name: str
    measured: float
    limit: float
    unit: str = ""
    least: bool = False

    @property
    def passed(self) -> bool:
        """The verdict; NaN fails."""
        return bool(self.measured >= self.limit if self.least else self.measured <= self.limit)

    def line(self) -> str:
        """The finding as one line of a report."""
        sign = ">=" if self.least else "<="
        return (
            f"{'ok  ' if self.passed else 'FAIL'} {self.name}: {self.measured:.4g} {sign} {self.limit:.4g} {self.unit}"
        )


def require(checks: list[Check], name: str) -> None:
    """Raise AnatomyError that names every check that failed."""
    failed = [check.line().removeprefix("FAIL ") for check in checks if not check.passed]
    if failed:
        raise AnatomyError("the built anatomy is not sound: " + "; ".join(failed), where=name)
