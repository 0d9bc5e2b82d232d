"""First poses as they are found, kept in a journal so that an adaptation that was cut short need not search again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np

from adapt.fit.pose import PoseFit
from adapt.match.correspondences import Correspondences
from adapt.search.pose_score import ScoredPose
from capture.errors import FitError
from capture.journal import Journal


class FoundPoses:
    """What searches led to, in this run or in an earlier one that the journal tells of."""

    def __init__(self, journal: Journal | None) -> None:
        self._journal = journal
        self._known = {entry["search"]: entry for entry in journal.entries} if journal else {}

    def find(self, name: str, search: Callable[[], ScoredPose]) -> ScoredPose:
        """What ``search`` finds; a search of that ``name`` is not done twice.

        Raises:
            FitError: the search finds nothing, now or then.
        """
        if name in self._known:
            return _result(self._known[name])
        try:
            pose = search()
        except FitError as error:
            self._keep({"search": name, "problem": error.problem, "where": error.where, "remedy": error.remedy})
            raise
        self._keep({"search": name, "pose": asdict(pose)})
        return pose

    def _keep(self, entry: dict[str, Any]) -> None:
        if self._journal is not None:
            self._journal.append(entry)


def _result(entry: dict[str, Any]) -> ScoredPose:
    if "pose" not in entry:
        raise FitError(entry["problem"], where=entry["where"], remedy=entry["remedy"])
    fit = entry["pose"]["fit"]
    arrays = {name: np.array(values) for name, values in fit.items() if name != "matches"}
    matches = {name: np.array(values) for name, values in fit["matches"].items()}
    matches.setdefault("trust", np.ones(len(matches["vertex"])))  # a journal of before it was written down
    return ScoredPose(**entry["pose"] | {"fit": PoseFit(matches=Correspondences(**matches), **arrays)})
