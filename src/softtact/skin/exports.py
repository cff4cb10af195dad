"""A skin's taxels for other programs: iCub's text format, URDF, MuJoCo."""

from pathlib import Path
from xml.etree import ElementTree as xml

import numpy as np
from scipy.spatial.transform import Rotation

import softtact
from softtact.files import atomic_path

_M = 1e-3  # metres in a millimetre: all three formats are in metres


def write_exports(folder: str | Path, name: str, positions_mm: np.ndarray, normals: np.ndarray, *, radius_mm: float) -> list[Path]:
    """Write NAME.txt, NAME.urdf and NAME.xml of taxels at (taxel, 3) with unit normals (taxel, 3); return their paths."""
    folder = Path(folder)
    texts = {
        folder / f"{name}.txt": icub_text(name, positions_mm, normals),
        folder / f"{name}.urdf": urdf(name, positions_mm, normals),
        folder / f"{name}.xml": mujoco_xml(name, positions_mm, normals, radius_mm=radius_mm),
    }
    for path, text in texts.items():
        with atomic_path(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return list(texts)


def icub_text(name: str, positions_mm: np.ndarray, normals: np.ndarray) -> str:
    """The skin of an iCub part: four lines about it, then `x y z nx ny nz` for each taxel in m, as its skinManager reads them."""
    rows = [
        " ".join(f"{value:.6f}" for value in (*(_M * place), *normal)) for place, normal in zip(positions_mm, normals, strict=True)
    ]
    return "\n".join(
        [f"name {name}", f"version softtact_{softtact.__version__}", f"numTaxels {len(rows)}", "[calibration]", *rows, ""]
    )


def urdf(name: str, positions_mm: np.ndarray, normals: np.ndarray) -> str:
    """A link with a massless frame for each taxel, its z axis along the normal."""
    robot = xml.Element("robot", name=name)
    xml.SubElement(robot, "link", name=name)
    for number, (place, normal) in enumerate(zip(positions_mm, normals, strict=True), start=1):
        xml.SubElement(robot, "link", name=f"{name}_taxel_{number}")
        joint = xml.SubElement(robot, "joint", name=f"{name}_joint_{number}", type="fixed")
        xml.SubElement(joint, "parent", link=name)
        xml.SubElement(joint, "child", link=f"{name}_taxel_{number}")
        roll, pitch = -np.arcsin(np.clip(normal[1], -1.0, 1.0)), np.arctan2(normal[0], normal[2])  # that take z to the normal
        xml.SubElement(joint, "origin", xyz=_row(_M * place), rpy=_row((roll, pitch, 0.0)))
    return _text(robot)


def mujoco_xml(name: str, positions_mm: np.ndarray, normals: np.ndarray, *, radius_mm: float) -> str:
    """A body of sites, one a taxel, each with a touch sensor; include it, or copy the sites into a body of your own."""
    model = xml.Element("mujoco", model=name)
    body = xml.SubElement(xml.SubElement(model, "worldbody"), "body", name=name)
    sensors = xml.SubElement(model, "sensor")
    for number, (place, normal) in enumerate(zip(positions_mm, normals, strict=True), start=1):
        x, y, z, w = upright(normal).as_quat()
        xml.SubElement(
            body,
            "site",
            name=f"{name}_{number}",
            type="cylinder",
            size=_row((_M * radius_mm, 0.5 * _M)),
            pos=_row(_M * place),
            quat=_row((w, x, y, z)),
        )
        xml.SubElement(sensors, "touch", name=f"{name}_touch_{number}", site=f"{name}_{number}")
    return _text(model)


def upright(normal: np.ndarray) -> Rotation:
    """The smallest rotation that takes z to a unit normal."""
    axis = np.cross([0.0, 0.0, 1.0], normal)
    sine, cosine = np.linalg.norm(axis), float(normal[2])
    if sine < 1e-12:
        return Rotation.from_rotvec([0.0 if cosine > 0 else np.pi, 0.0, 0.0])
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, cosine))


def _row(values):
    return " ".join(f"{value:.9g}" for value in values)


def _text(root):
    xml.indent(root)
    return xml.tostring(root, encoding="unicode") + "\n"
