"""The sensor as MJCF text for others: MuJoCo loads it alone, and its taxels lie where those of the sensor are."""

import numpy as np
import pytest

import softtact
from softtact.errors import InputError

mujoco = pytest.importorskip("mujoco", reason="pip install 'softtact[robot]'")
from softtact.robot import export_mjcf  # noqa: E402

CORO = softtact.load_sensor("coro").spec
ROWS, COLUMNS = CORO.taxels.rows, CORO.taxels.columns


def counts_under(text, x_mm, y_mm, *, shape="sphere", size=".004", mass=0.1):
    """Readings (row, column) in N, without their sign, of a body that rests on the pad for a while."""
    ball = f'<body pos="{1e-3 * x_mm} {1e-3 * y_mm} .0041"><freejoint/><geom type="{shape}" size="{size}" mass="{mass}"/></body>'
    model = mujoco.MjModel.from_xml_string(text.replace("</worldbody>", ball + "</worldbody>"))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=200)
    return np.abs(data.sensordata.reshape(ROWS, COLUMNS))


@pytest.mark.parametrize("plugin", [True, False])
@pytest.mark.parametrize(("row", "column"), [(0, 0), (2, 1), (6, 3)])
def test_a_ball_on_a_taxel_is_felt_by_it_alone_with_its_weight(plugin, row, column):
    width, length = CORO.footprint_mm
    x, y = width * ((column + 0.5) / COLUMNS - 0.5), length * ((row + 0.5) / ROWS - 0.5)
    found = counts_under(export_mjcf("coro", plugin=plugin), x, y)
    wanted = np.zeros((ROWS, COLUMNS))
    wanted[row, column] = 0.1 * 9.81
    assert found == pytest.approx(wanted, rel=0.01, abs=1e-9)


@pytest.mark.parametrize("plugin", [True, False])
def test_taxels_meet_at_their_sides(plugin):
    text = export_mjcf("coro", plugin=plugin)
    side = CORO.footprint_mm[0] / COLUMNS
    beside = [counts_under(text, x, 0.0) for x in (side - 0.05, side + 0.05)]
    assert [int(one.sum(axis=0).argmax()) for one in beside] == [2, 3]


def test_a_box_is_felt_under_its_corners_alone_which_the_page_says():
    found = counts_under(export_mjcf("coro"), 0.0, 0.0, shape="box", size=".008 .012 .004")
    assert found.sum() == pytest.approx(0.1 * 9.81, rel=0.01) and (found > 1e-6).sum() == 4


def test_the_text_can_be_attached_to_a_hand():
    hand = mujoco.MjSpec.from_string('<mujoco><worldbody><body name="finger"><geom size=".01"/></body></worldbody></mujoco>')
    frame = hand.body("finger").add_frame(pos=[0, 0, 0.01])
    frame.attach_body(mujoco.MjSpec.from_string(export_mjcf("coro", plugin=False)).body("coro"), "left_", "")
    model = hand.compile()
    assert model.nsensor == ROWS * COLUMNS and model.body("left_coro").parentid[0] == model.body("finger").id


def test_a_sensor_without_taxels_is_refused():
    with pytest.raises(InputError, match="gelsight_mini has no taxels, which a touch sensor of MuJoCo needs"):
        export_mjcf("gelsight_mini")
