"""DAE files (COLLADA 1.4 and 1.5), scenes that state their unit: the triangles of all bodies in their places (`pycollada`)."""

import io
import warnings
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.geometry.xml_meshes import refuse_document_type
from softtact.inputs import in_one_sentence

_UNITS = {1.0: "m", 0.01: "cm", 0.001: "mm", 0.0254: "inch", 0.3048: "foot", 1e-6: "micron"}


def read_dae(path: Path, data: bytes) -> tuple[np.ndarray, str, str]:
    """Triangles (n, 3, 3) of a DAE file in its unit, the unit's name, and the axis that points up.

    Raises InputError that says what is wrong.
    """
    import collada  # of an extra: where it is missing, the command says which

    refuse_document_type(path, data)
    with in_one_sentence(path, "not a readable DAE file", "export it again"), warnings.catch_warnings():
        warnings.simplefilter("ignore")     # of NumPy's matrices, which it uses
        scene = collada.Collada(io.BytesIO(data))
        if scene.scene is None:
            raise InputError(f"{path}: it shows no scene; export it again.")
        parts = [_triangles(body, primitive) for body in scene.scene.objects("geometry") for primitive in body.primitives()]
        meter = float(1.0 if scene.assetInfo.unitmeter is None else scene.assetInfo.unitmeter)
        unit = next((name for size, name in _UNITS.items() if abs(size - meter) < 1e-6 * size), None)
        if unit is None:
            raise InputError(f"{path}: its unit of {meter:g} m is none of {', '.join(_UNITS.values())}; export it again.")
        return np.concatenate([np.empty((0, 3, 3)), *parts]), unit, str(scene.assetInfo.upaxis or "Y_UP")[0].lower()


def _triangles(body, primitive):
    """The triangles of a part of a body; none of lines."""
    if hasattr(primitive, "triangleset"):     # polygons
        primitive = primitive.triangleset()
    if type(primitive).__name__ not in ("BoundTriangleSet", "TriangleSet") or primitive.vertex_index is None:
        return np.empty((0, 3, 3))
    triangles = np.asarray(primitive.vertex[primitive.vertex_index], dtype=float)
    return triangles[:, ::-1] if np.linalg.det(body.matrix[:3, :3]) < 0 else triangles     # a mirrored body keeps its outside
