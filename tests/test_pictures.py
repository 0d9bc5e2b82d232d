"""Pictures of a fit say what they show: a title, a name over each part, a key of the colours."""

from __future__ import annotations

import cv2

from capture.own import PNG
from track.view.pictures import picture_fit


def test_a_picture_says_what_it_shows(limb, tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    said = []
    drawn = Figure.savefig

    def noted(figure, *arguments, **more):
        said.append(figure.get_suptitle())
        said.extend(axes.get_title() for axes in figure.axes)
        said.extend(text.get_text() for key in figure.legends for text in key.get_texts())
        return drawn(figure, *arguments, **more)

    monkeypatch.setattr(Figure, "savefig", noted)
    path = tmp_path / "fit.png"
    picture_fit(limb.subject.body, limb.thetas[4], limb.targets[4].cloud, path, title="frame 4 at 0.13 s")
    assert said[0] == "frame 4 at 0.13 s"
    assert {"from the first sensor", "from its side", "skin of the model", "bones", "points of the sensors"} <= set(
        said
    )
    assert PNG.is_on(path)
    height, width, _ = cv2.imread(str(path)).shape
    assert (width, height) == (1440, 540)
