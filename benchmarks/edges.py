"""Where a mesh feels the edge of a punch: `python benchmarks/edges.py`, two minutes.

A square and a round punch on 36 frusta, 1.5 N, wider from press to press, so that their edge crosses an element of the cover. Told
is by how much indentation and map differ from those on elements an eighth as wide at the edge, all else alike: the numbers of
`softtact/contact/edges.py` were chosen by the square one. Record: benchmarks/results/edges.json.
"""

import mesh_error
import numpy as np
import record
import trimesh

from softtact.models.hyperelastic.mesh_settings import MeshSettings

FORCE_N = 1.5
HALF_WIDTHS_MM = np.round(np.arange(2.40, 2.77, 0.04), 2)     # elements end at 2.4, 2.7 and 3.0 mm
LAYERS = {"cover_heights": mesh_error.THREE_LAYERS}
MESHES = {"elements of 0.3 mm": MeshSettings(cover_splits=(1, 1, 2), **LAYERS),
          "an eighth": MeshSettings(cover_splits=(1, 1, 5), **LAYERS)}


def square(half):
    """A punch of this half width in mm."""
    return trimesh.creation.box((2 * half, 2 * half, 2.0), trimesh.transformations.translation_matrix((0, 0, 1)))


def circle(radius):
    """A punch of this radius in mm."""
    return trimesh.creation.cylinder(radius=radius, height=2.0, sections=96)


def press(mesh, body):
    """Indentation (mm) and map (mm)."""
    result = mesh_error.small_sensor(mesh).press(body, force_n=[FORCE_N], model="hyperelastic", threads=1, label="")
    return result.indentation_mm[0], result.deformation_map_mm[0]


def row_of(shape, half):
    """One punch on both meshes."""
    (coarse, coarse_map), (fine, fine_map) = (press(mesh, shape(half)) for mesh in MESHES.values())
    return {"punch": shape.__name__, "half_width_mm": float(half), "indentation_mm": round(float(fine), 5),
            "indentation_error_percent": round(100 * float(coarse / fine - 1), 2),
            "map_error_percent": round(100 * float(np.abs(coarse_map - fine_map).max() / fine_map.max()), 2)}


def main():
    """A line for each punch, and the record."""
    mesh_error.OVERLAP_MM, rows = 1e-3, []
    for shape in (square, circle):
        for half in HALF_WIDTHS_MM:
            rows.append(row_of(shape, half))
            print("{punch:8}{half_width_mm:6.2f} mm: {indentation_mm:.4f} mm deep, {indentation_error_percent:5.2f} % off, "
                  "map by {map_error_percent:.2f} %".format(**rows[-1]), flush=True)
    print(record.write("edges", force_n=FORCE_N, rows=rows))


if __name__ == "__main__":
    main()
