"""The study on recordings of a real sensor: what is planned."""

import pytest
import yaml
from project import Project
from support.recordings import write_recordings

ITEMS = ["indenters/circle_m", "indenters/square", "indenters/donut_m", "unseen/ellipse", "grasps/object_5"]


@pytest.fixture
def project(tmp_path):
    """The tiny study with two recordings of each item."""
    made = Project.of_sources(tmp_path)
    entries = write_recordings(made.folder / "recordings", ITEMS, trials=2)
    values = yaml.safe_load((made.folder / "config/tiny.yaml").read_text())
    values |= {"study": "recorded", "data": {"source": "recorded", "recordings": entries}}
    (made.folder / "config/tiny_recorded.yaml").write_text(yaml.safe_dump(values))
    made.configfile = "config/tiny_recorded.yaml"
    return made


@pytest.mark.slow
def test_items_are_pressed_and_recordings_stand_for_the_virtual_sensor(project):
    plan = project.plan()
    assert {f"{job['set']}/{job['item']}" for job in plan["read_recordings"]} == set(ITEMS)
    assert {job["model"] for job in plan["simulate_press"]} == {"elastic", "foundation", "hyperelastic"}
    assert {"build_dataset", "compare_policies", "draw_fig7_maps", "draw_fig8_policies", "find_limits", "report"} <= set(plan)
    assert not {"read_virtual_sensor", "compare_gains", "import_published"} & set(plan)
