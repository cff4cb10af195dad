"""The generated objects: closed, same bytes again, sized for the sensor and its full force."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from make_objects import LOW_FEATURE, make_mesh, object_5, object_6, to_mesh, write_objects
from scipy import ndimage

from softtact.contact.height_field import HeightField
from softtact.geometry.meshes import default_pose, place, read_mesh

OBJECTS = Path(__file__).parents[2] / "config" / "objects"
CATALOGUE = yaml.safe_load((OBJECTS / "catalogue.yaml").read_text())


@cache
def mesh_in(file, unit):
    return place(read_mesh(OBJECTS / file, unit=unit))


def mesh_of(entry):
    return mesh_in(entry["file"], entry["unit"])


def names(entries, fault):
    """Names of the objects whose mesh has a fault."""
    return [entry["name"] for entry in entries if fault(mesh_of(entry))]


def area_within(mesh, depth):
    """Area in mm2, seen from above, of the downward facets at most `depth` mm over the lowest point."""
    low = (mesh.triangles_center[:, 2] <= depth) & (mesh.face_normals[:, 2] < 0)
    return float(np.sum(mesh.area_faces[low] * -mesh.face_normals[low, 2]))


def test_the_catalogue_holds_the_sets_and_no_name_twice():
    sets = [entry["set"] for entry in CATALOGUE]
    assert {name: sets.count(name) for name in set(sets)} == {"indenters": 49, "unseen": 10, "grasps": 15}
    assert len({entry["name"] for entry in CATALOGUE}) == len(CATALOGUE)


def test_the_files_on_disk_are_what_the_code_draws(tmp_path):
    write_objects(tmp_path)
    files = sorted(path.relative_to(OBJECTS) for path in OBJECTS.rglob("*.stl"))
    assert files == sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*.stl"))
    changed = [str(file) for file in files if (OBJECTS / file).read_bytes() != (tmp_path / file).read_bytes()]
    assert not changed
    assert (tmp_path / "catalogue.yaml").read_text() == (OBJECTS / "catalogue.yaml").read_text()


def silhouette(entry, *, step=0.5, half=20.0):
    """Where an object touches within 1 mm of its lowest point, about that patch's middle: a square image of 0 and 1."""
    x, y = np.meshgrid(*[np.arange(-half, half, step) + step / 2] * 2)
    underside = HeightField(mesh_of(entry))
    touched = underside(x.ravel(), y.ravel())[0] < 1.0
    middle = x.ravel()[touched].mean(), y.ravel()[touched].mean()
    return (underside(x.ravel() + middle[0], y.ravel() + middle[1])[0] < 1.0).reshape(x.shape).astype(np.float32)


def turned_and_mirrored(image):
    """An image in all attitudes, in steps of 15 degrees: (attitude, pixel)."""
    turned = [ndimage.rotate(each, angle, reshape=False, order=1)
              for each in (image, image[:, ::-1]) for angle in range(0, 360, 15)]
    return np.stack(turned).reshape(len(turned), -1)


def test_no_unseen_indenter_is_a_trained_one_turned_mirrored_or_moved():
    """Overlap over union of the touching patches: 1 is the same shape. A hexagon is nearly a circle (0.93)."""
    trained = np.stack([silhouette(entry).ravel() for entry in CATALOGUE if entry["set"] == "indenters"])
    for entry in (entry for entry in CATALOGUE if entry["set"] == "unseen"):
        turned = turned_and_mirrored(silhouette(entry))
        both = trained @ turned.T
        overlap = both / (trained.sum(axis=1)[:, None] + turned.sum(axis=1) - both)
        assert overlap.max() < (0.95 if entry["name"] == "hexagon" else 0.88), entry["name"]


def test_each_file_is_one_closed_body_of_modest_size():
    """Reading refuses what is not closed."""
    assert names(CATALOGUE, lambda mesh: mesh.body_count != 1 or len(mesh.faces) > 20_000 or mesh.bounds[0, 2] != 0) == []


def test_each_object_carries_the_full_force_within_the_soft_layers():
    assert names(CATALOGUE, lambda mesh: area_within(mesh, depth=1.0) < 90.0) == []


def test_each_indenter_fits_the_sensor_and_has_its_plate_out_of_reach():
    """A plate of 3 mm over the 2.5 mm of the soft layers."""
    indenters = [entry for entry in CATALOGUE if entry["set"] != "grasps"]
    assert names(indenters, lambda mesh: (mesh.extents > (20, 34, np.inf)).any() or mesh.extents[2] < 3 + 2.5) == []


def heights_of_downward_faces(mesh):
    """Heights in mm of the horizontal faces that look at the sensor, with their areas in mm2."""
    flat = mesh.face_normals[:, 2] < -0.999
    height = np.round(mesh.triangles_center[flat, 2], 3)
    return {level: mesh.area_faces[flat][height == level].sum() for level in np.unique(height)}


def test_objects_5_and_6_have_features_half_a_millimetre_apart():
    for draw in [object_5, object_6]:
        areas = heights_of_downward_faces(to_mesh(draw()))
        assert LOW_FEATURE == 0.5, draw
        assert areas[0.0] >= 90 and areas[LOW_FEATURE] >= 40, draw
        assert set(areas) <= {0.0, LOW_FEATURE, 3.0}, draw


def test_a_disc_has_the_area_of_its_circle_less_the_rounded_edge():
    areas = heights_of_downward_faces(make_mesh("indenters", "Circle G"))
    assert areas[0.0] == pytest.approx(np.pi * (9 - 0.25) ** 2, rel=0.01)  # polygon within 0.02 mm of its circle


def test_the_default_pose_of_an_indenter_is_its_drawing():
    mesh = read_mesh(OBJECTS / "indenters" / "diagonal.stl", unit="mm")
    assert default_pose(mesh).translation_mm == pytest.approx([0, 0, 0], abs=1e-6)
