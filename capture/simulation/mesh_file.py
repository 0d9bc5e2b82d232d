"""Moving meshes from files: what ``bonetrack simulate --mesh`` records."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from capture.errors import RecordingError
from capture.files import UNREADABLE
from capture.recording import Recording
from capture.rigid import Floats
from capture.simulation.mesh_axes import MeshAxes, require_outward, require_standing
from capture.simulation.rig import Ints
from capture.simulation.sensor import NoiseModel
from capture.simulation.simulate import checked_faces, checked_vertices, simulate_recording


def simulate_mesh_file(
    mesh: Path,
    out: Path,
    *,
    axes: MeshAxes | None = None,
    noise: NoiseModel | None = None,
    seed: int = 0,
    overwrite: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Recording:
    """Record the moving mesh of an ``.npz`` file: ``vertices`` (T, V, 3) m, ``faces`` (F, 3), ``fps``.

    ``axes`` say which of the file's axes point up and forward; where they are not given they are X forward, Y up,
    Z right, and a mesh that seems to lie in them is refused. The recording's world has those axes in either case.

    Raises:
        RecordingError: the file is not such a file, the mesh lies or is turned inside out, or as
            ``simulate_recording``.
    """
    vertices, faces, fps = _read_mesh_file(mesh)
    try:
        faces = checked_faces(faces)
        first = checked_vertices(vertices[0], faces, 0)
        require_outward(first, faces)
        if axes is None:
            require_standing(first)
        else:
            vertices = axes.turned(vertices)
        return simulate_recording(
            out,
            vertices,
            faces,
            (np.arange(len(vertices)) / fps).tolist(),
            noise=noise,
            seed=seed,
            overwrite=overwrite,
            progress=progress,
        )
    except RecordingError as error:
        if error.where is not None:
            raise
        raise RecordingError(error.problem, where=mesh, remedy=error.remedy) from error


def _read_mesh_file(path: Path) -> tuple[Floats, Ints, float]:
    """Vertices (T, V, 3) m, faces (F, 3) and frames per second of a mesh file."""
    try:
        with np.load(path, allow_pickle=False) as data:
            missing = [key for key in ("vertices", "faces", "fps") if key not in data]
            arrays = {} if missing else {key: np.asarray(data[key]) for key in ("vertices", "faces", "fps")}
    except FileNotFoundError as error:
        raise RecordingError("does not exist", where=path, remedy="name the mesh's .npz file") from error
    except UNREADABLE as error:
        raise RecordingError("is not an .npz file of plain arrays", where=path, remedy="use numpy.savez") from error
    if missing:
        raise RecordingError(
            f"has no {', '.join(missing)}", where=path, remedy="store vertices (T, V, 3) m, faces (F, 3) and fps"
        )
    vertices, fps = arrays["vertices"], arrays["fps"]
    if vertices.ndim != 3 or vertices.shape[2] != 3 or vertices.dtype.kind != "f" or not vertices.size:
        raise RecordingError(
            f"vertices must be floating point numbers (T, V, 3), got {vertices.dtype} {vertices.shape}", where=path
        )
    if fps.size != 1 or fps.dtype.kind not in "iuf" or not 0.0 < float(fps.reshape(())) < np.inf:
        problem = f"fps must be one positive number, got {fps}"
        raise RecordingError(problem, where=path, remedy="store fps as one number, as 30.0")
    return vertices.astype(np.float64), arrays["faces"], float(fps.reshape(()))
