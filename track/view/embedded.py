"""A scene as one HTML file that plays without a network: viser's own player with the frames inside.

To stay small the skin is thinned, what moves little is rounded, and of a long motion some frames are left out.
"""

from __future__ import annotations

from dataclasses import replace
from html import escape
from pathlib import Path

import numpy as np

from adapt.anatomy import Floats, Ints
from adapt.model.body import rest_theta
from capture.cloud.fuse import Region
from capture.own import HTML, HTML_META, refuse_foreign, replaced_if_own
from track.view.frames import FrameContent, FrameStore, SeenPoints, Single, pose_body
from track.view.layers import FAR_M, LARGEST_ERROR_M, Layers, Skin, first_eye, set_eye
from track.view.scene import Scene
from track.view.viewer import start_server, stop_server

MOST_FRAMES, SKIN_VERTICES = 300, 2500
_GRAIN_M = 2.0**-11  # skin and points are rounded to half a millimetre: single precision of fewer digits packs well


def write_embedded(scene: Scene, path: Path, *, most_frames: int = MOST_FRAMES, region: Region | None = None) -> int:
    """Write the scene as one HTML file; returns how many frames it has.

    Raises:
        ViewError: viser is not installed.
        OutputError: something stands there that bonetrack did not write.
    """
    refuse_foreign(path, HTML)  # told before the work, not after it
    server = start_server(port=_ANY_PORT)
    try:
        frames = FrameStore(scene, capacity=1, region=region)
        layers = Layers(server, scene, skin=_thinned(scene))
        for name in layers.names():
            layers.switch(name, name != "truth")
        set_eye(server, first_eye(scene, frames))
        server.scene.configure_default_lights(cast_shadow=False)
        step = -(-len(scene.times) // most_frames)
        chosen = list(range(0, len(scene.times), step))
        recorded = server.get_scene_serializer()
        for k, following in zip(chosen, [*chosen[1:], None], strict=True):
            layers.show(k, _coarse(frames.get(k)), theta=None if scene.body is None else scene.angles[k])
            server.flush()
            if len(chosen) > 1:
                recorded.insert_sleep(float(scene.times[following] - scene.times[k]) if following else 1.0 / 30.0)
        page = recorded.as_html()
    finally:
        stop_server(server)
    with replaced_if_own(path, HTML) as partial:
        partial.write_text(_with_caption(page, scene, step), encoding="utf-8")
    return len(chosen)


_ORDINALS = {2: "2nd", 3: "3rd"}
_ANY_PORT = 18080  # the first of which the server takes a free one


def _coarse(content: FrameContent) -> FrameContent:
    seen = content.seen
    if seen is not None and len(seen.points):
        seen = SeenPoints(_rounded(seen.points), seen.distances, seen.problem)
    posed = content.posed
    if posed is not None:
        posed = replace(posed, skin=_rounded(posed.skin))
    return FrameContent(posed, content.truth, seen)


def _rounded(points: Single) -> Single:
    return (np.round(points / _GRAIN_M) * _GRAIN_M).astype(np.float32)


def _thinned(scene: Scene) -> Skin | None:
    """Fewer triangles between vertices of the rest skin that are kept as they are."""
    if scene.body is None:
        return None
    rest = pose_body(scene.body, rest_theta(scene.body))
    if rest is None:
        return None
    vertices, faces = thinned(rest.skin.astype(np.float64), scene.body.anatomy.skin_faces, SKIN_VERTICES)
    return Skin(vertices, faces)


def thinned(vertices: Floats, faces: Ints, about: int) -> tuple[Ints, Ints]:
    """About so many of the vertices (V, 3) and triangles between them: every vertex goes to the nearest one kept.

    Returns the indices of the kept vertices and faces of theirs.
    """
    from scipy.spatial import cKDTree

    kept = _spread(vertices, about)
    _, nearest = cKDTree(vertices[kept]).query(vertices)
    merged = np.asarray(nearest, dtype=np.int64)[faces]
    whole = (merged[:, 0] != merged[:, 1]) & (merged[:, 1] != merged[:, 2]) & (merged[:, 2] != merged[:, 0])
    return kept, merged[whole]


def _spread(vertices: Floats, about: int) -> Ints:
    """Indices of about so many vertices (V, 3), each the first in its cube of space."""
    if len(vertices) <= about:
        return np.arange(len(vertices))
    low, high = 1e-4, float(np.ptp(vertices, axis=0).max())
    for _ in range(30):
        middle = np.sqrt(low * high)
        first = np.unique(np.floor(vertices / middle).astype(np.int64), axis=0, return_index=True)[1]
        low, high = (middle, high) if len(first) > about else (low, middle)
    return np.sort(first)


def _with_caption(page: str, scene: Scene, step: int) -> str:
    """The page with its writer, a title, and a caption that says what is seen."""
    parts = []
    if scene.body is not None:
        parts.append("translucent skin, bones inside")
    if scene.recording is not None:
        what = f"points coloured by their distance to the skin (violet 0 mm, orange {1e3 * LARGEST_ERROR_M:.0f} mm "
        parts.append(what + f"and more, grey over {1e3 * FAR_M:.0f} mm)" if scene.body is not None else "points")
    if scene.truth is not None:
        parts.append("true bones in green (off: switch on under the tree symbol)")
    if scene.markers is not None:
        parts.append("a laboratory's markers in magenta")
    if step > 1:
        parts.append(f"every {_ORDINALS.get(step, f'{step}th')} frame")
    words = "; ".join(parts)
    caption = (
        "<div style='position:fixed;left:12px;top:12px;max-width:26rem;font:13px/1.4 sans-serif;color:#333;"
        "background:rgba(255,255,255,0.85);padding:8px 12px;border-radius:6px;z-index:5'>"
        f"<b>{escape(scene.title)}</b><br>{escape(words[:1].upper() + words[1:])}. Angles ± 1 SD. Drag to turn.</div>"
    )
    page = page.replace("<head>", f"<head>{HTML_META}", 1)
    page = page.replace("<title>Viser</title>", f"<title>bonetrack: {escape(scene.title)}</title>", 1)
    end = page.rindex("</body>")
    return page[:end] + caption + page[end:]
