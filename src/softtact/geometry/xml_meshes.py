"""3MF and AMF files, which state their unit: the bodies that they build, each in its place.

3MF (core specification 1.3, production extension): a ZIP archive with a model of objects, components and build items. Read are the
items to build with all transforms; objects of supports and of other uses are left out. AMF (ISO/ASTM 52915): XML, as it is or
packed; objects in their constellations. Colours, materials and curved triangles' tangents are passed over.
"""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from softtact.errors import InputError
from softtact.geometry.archives import ZIP, Archive
from softtact.inputs import check_limit, in_one_sentence

_3MF_UNITS = {"micron": "micron", "millimeter": "mm", "centimeter": "cm", "inch": "inch", "foot": "foot", "meter": "m"}
_AMF_UNITS = {"millimeter": "mm", "inch": "inch", "feet": "foot", "foot": "foot", "meter": "m", "micron": "micron"}
_IN_FILE = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}path"
_MODEL_TYPE = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_BODIES = ("model", "solidsupport")     # uses of an object that are part of the body
_EMPTY = np.empty((0, 3, 3))
_AGAIN = "export the mesh again"


def read_3mf(path: Path, data: bytes) -> tuple[np.ndarray, str]:
    """Triangles (n, 3, 3) of a 3MF file in its unit, and the unit's name; InputError says what is wrong."""
    with in_one_sentence(path, "not a readable 3MF file", _AGAIN):
        return _Package(path, data).built()


def read_amf(path: Path, data: bytes) -> tuple[np.ndarray, str]:
    """Triangles (n, 3, 3) of an AMF file in its unit, and the unit's name; InputError says what is wrong."""
    with in_one_sentence(path, "not a readable AMF file", _AGAIN):
        if data.startswith(ZIP):
            archive = Archive(path, data)
            data = archive.read(next((name for name in archive.names if name.lower().endswith(".amf")), "*.amf"))
        root = _parsed(path, data)
        return _Constellations(path, root).all(), _unit(path, root, _AMF_UNITS)


def _parsed(path, data):
    refuse_document_type(path, data)
    return ET.fromstring(data)


def refuse_document_type(path: Path, data: bytes) -> None:
    """Refuse XML that declares entities, of which a few bytes may become gigabytes."""
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data:
        raise InputError(f"{path}: it declares a document type, which no mesh needs; {_AGAIN}.")


def _unit(path, root, known):
    """The name of the unit that a root element states; millimetres are the default of both formats."""
    unit = root.get("unit", "millimeter")
    if unit.strip().lower() not in known:
        raise InputError(f"{path}: its unit {unit!r} is none of {', '.join(known)}; {_AGAIN}.")
    return known[unit.strip().lower()]


def _triangles(path, points, corners):
    """Triangles (n, 3, 3) of words: of points (k, 3), and of the numbers (n, 3) of their points."""
    points, corners = np.array(points, dtype=float).reshape(-1, 3), np.array(corners, dtype=np.int64).reshape(-1, 3)
    check_limit(path, "facets", len(corners))
    wrong = corners[(corners < 0) | (corners >= len(points))]
    if len(wrong):
        raise InputError(f"{path}: a corner is vertex {wrong[0]}, but the mesh's {len(points)} vertices are 0 to "
                         f"{len(points) - 1}; {_AGAIN}.")
    return points[corners]


def _gathered(path, parts):
    """Triangles of parts, as long as they are not too many together: objects of objects multiply."""
    check_limit(path, "facets", sum(map(len, parts)))
    return np.concatenate([_EMPTY, *parts])


class _Tree:
    """Objects that may consist of others: each is found once, and none may hold itself."""

    def __init__(self, path):
        self.path, self._known, self._open = path, {}, set()

    def triangles(self, key):
        """Triangles (n, 3, 3) of an object."""
        if key not in self._known:
            if key in self._open:
                raise InputError(f"{self.path}: the object {key[-1]} is a component of itself; {_AGAIN}.")
            self._open.add(key)
            self._known[key] = self._found(key)
            self._open.discard(key)
        return self._known[key]

    def _missing(self, key):
        return InputError(f"{self.path}: it holds no object {key[-1]}, which it builds; {_AGAIN}.")

    def _found(self, key):
        raise NotImplementedError


class _Package(_Tree):
    """The models of a 3MF package; an object's key is its model's file and its number."""

    def __init__(self, path, data):
        super().__init__(path)
        self._archive, self._models = Archive(path, data), {}

    def built(self):
        """The triangles of all items to build, and their unit."""
        file = self._main()
        root = self._model(file)
        items = [self._placed(file, item) for item in root.iterfind("{*}build/{*}item")]
        return _gathered(self.path, items), _unit(self.path, root, _3MF_UNITS)

    def _main(self):
        """The name of the file of the package's model."""
        relations = _parsed(self.path, self._archive.read("_rels/.rels")) if "_rels/.rels" in self._archive.names else ()
        target = next((one.get("Target") for one in relations if one.get("Type") == _MODEL_TYPE), "3D/3dmodel.model")
        return target.lstrip("/")

    def _model(self, file):
        if file not in self._models:
            self._models[file] = _parsed(self.path, self._archive.read(file))
        return self._models[file]

    def _placed(self, file, reference):
        """The triangles of an item or a component, moved by its transform."""
        file = reference.get(_IN_FILE, file).lstrip("/")
        triangles = self.triangles((file, reference.get("objectid")))
        words = reference.get("transform")
        return triangles if words is None else _moved(triangles, np.array(words.split(), dtype=float).reshape(4, 3))

    def _found(self, key):
        file, number = key
        body = next((one for one in self._model(file).iterfind("{*}resources/{*}object") if one.get("id") == number), None)
        if body is None:
            raise self._missing(key)
        if body.get("type", "model") not in _BODIES:
            return _EMPTY
        parts = [self._placed(file, one) for one in body.iterfind("{*}components/{*}component")]
        for mesh in body.iterfind("{*}mesh"):
            points = [[one.get(axis) for axis in "xyz"] for one in mesh.iterfind("{*}vertices/{*}vertex")]
            corners = [[one.get(name) for name in ("v1", "v2", "v3")] for one in mesh.iterfind("{*}triangles/{*}triangle")]
            parts.append(_triangles(self.path, points, corners))
        return _gathered(self.path, parts)


def _moved(triangles, matrix):
    """Triangles under a matrix (4, 3) that rows of coordinates are multiplied by; those that it mirrors keep their outside."""
    moved = triangles @ matrix[:3] + matrix[3]
    return moved[:, ::-1] if np.linalg.det(matrix[:3]) < 0 else moved


class _Constellations(_Tree):
    """The objects and constellations of an AMF file; a key is a tuple of the identity."""

    def __init__(self, path, root):
        super().__init__(path)
        self._of = {one.get("id"): one for one in root if _tag(one) in ("object", "constellation")}

    def all(self):
        """The triangles of all constellations, or of all objects where there is none."""
        groups = [key for key, one in self._of.items() if _tag(one) == "constellation"]
        held = {one.get("objectid") for key in groups for one in self._of[key].iterfind("{*}instance")}
        whole = [key for key in groups if key not in held] or [key for key in self._of if key not in held]
        return _gathered(self.path, [self.triangles((key,)) for key in whole])

    def _found(self, key):
        one = self._of.get(key[0])
        if one is None:
            raise self._missing(key)
        if _tag(one) == "object":
            return _gathered(self.path, [self._mesh(mesh) for mesh in one.iterfind("{*}mesh")])
        return _gathered(self.path, [self._instance(instance) for instance in one.iterfind("{*}instance")])

    def _instance(self, instance):
        names = ("deltax", "deltay", "deltaz", "rx", "ry", "rz")
        x, y, z, *angles = (float(instance.findtext("{*}" + name, "0")) for name in names)
        turn = Rotation.from_euler("xyz", angles, degrees=True)
        triangles = self.triangles((instance.get("objectid"),))
        return _moved(triangles, np.vstack([turn.as_matrix().T, [x, y, z]]))

    def _mesh(self, mesh):
        points = [[one.findtext("{*}" + axis) for axis in "xyz"] for one in mesh.iterfind("{*}vertices/{*}vertex/{*}coordinates")]
        volumes = [one for one in mesh.iterfind("{*}volume") if one.get("type", "object") == "object"]
        corners = [[one.findtext("{*}" + name) for name in ("v1", "v2", "v3")] for volume in volumes
                   for one in volume.iterfind("{*}triangle")]
        return _triangles(self.path, points, corners)


def _tag(element):
    return element.tag.rpartition("}")[2]
