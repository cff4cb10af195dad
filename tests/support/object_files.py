"""Files of a box of 20 x 20 x 8 mm in formats that state a unit, or are read beside them."""

import io
import zipfile

import numpy as np
import trimesh

from tests.support.mesh_files import SQUARE, prism

BOX = prism(SQUARE, 8)                     # 20 x 20 x 8 mm, 3200 mm3
POINTS, FACES = BOX.triangles.reshape(-1, 3), np.arange(3 * len(BOX.triangles)).reshape(-1, 3)
CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"


def packed(**files):
    raw = io.BytesIO()
    with zipfile.ZipFile(raw, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return raw.getvalue()


def mesh_3mf(number=1, scale=1.0, kind="model"):
    points = "".join(f'<vertex x="{x:g}" y="{y:g}" z="{z:g}"/>' for x, y, z in scale * POINTS)
    corners = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in FACES)
    mesh = f"<mesh><vertices>{points}</vertices><triangles>{corners}</triangles></mesh>"
    return f'<object id="{number}" type="{kind}">{mesh}</object>'


def file_3mf(objects, items, unit='unit="millimeter"'):
    model = f'<model xmlns="{CORE}" {unit}><resources>{objects}</resources><build>{items}</build></model>'
    return packed(**{"3D/3dmodel.model": model})


def file_amf(unit='unit="millimeter"', constellation="", scale=1.0):
    points = "".join(f"<vertex><coordinates><x>{x:g}</x><y>{y:g}</y><z>{z:g}</z></coordinates></vertex>"
                     for x, y, z in scale * POINTS)
    corners = "".join(f"<triangle><v1>{a}</v1><v2>{b}</v2><v3>{c}</v3></triangle>" for a, b, c in FACES)
    return (f'<amf {unit}><object id="0"><mesh><vertices>{points}</vertices><volume>{corners}</volume></mesh></object>'
            f"{constellation}</amf>").encode()


def file_glb(*matrices, scale=1e-3):
    scene = trimesh.Scene()
    for matrix in matrices or (np.eye(4),):
        scene.add_geometry(trimesh.Trimesh(scale * POINTS, FACES), transform=matrix)
    return scene.export(file_type="glb")


def file_off(head="OFF\n8 6 0\n"):
    points = "".join(f"{x:g} {y:g} {z:g}\n" for x, y, z in BOX.points)
    faces = "".join(f"{len(face)} {' '.join(map(str, face))} 0.5 0.5 1\n" for face in BOX.polygons)
    return f"{head}# points\n{points}{faces}".encode()


def file_dae(unit='<unit name="millimeter" meter="0.001"/>', matrix="1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1"):
    """A box of 20 x 20 x 8 in a DAE file of polygons, moved by a node."""
    box = trimesh.creation.box(bounds=[[0, 0, 0], [20, 20, 8]])
    places, faces = " ".join(f"{value:g}" for value in box.vertices.ravel()), " ".join(map(str, box.faces.ravel()))
    return f"""<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
    <asset><created>2026-01-01T00:00:00Z</created><modified>2026-01-01T00:00:00Z</modified>{unit}<up_axis>Z_UP</up_axis></asset>
    <library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="24">{places}</float_array>
    <technique_common><accessor source="#a" count="8" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
    <param name="Z" type="float"/></accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="12"><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles></mesh></geometry>
    </library_geometries><library_visual_scenes><visual_scene id="s"><node id="n"><matrix>{matrix}</matrix>
    <instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
    <scene><instance_visual_scene url="#s"/></scene></COLLADA>""".encode()


ONE = '<item objectid="1"/>'
