"""Where taxels lie, and what is refused."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.skin.layout import hexagon_layout, module_layout


def test_the_default_module_is_the_published_one():
    layout = module_layout()
    assert layout.area_mm2 == pytest.approx(np.sqrt(3) / 4 * 30**2)
    assert layout.centres_mm.shape == (12, 2) and layout.centres_mm[6] == pytest.approx((15, 5.66), abs=0.001)


def test_a_hexagonal_patch_mirrors_each_module_at_the_side_it_shares():
    module = module_layout()
    patch = hexagon_layout(module)
    assert patch.centres_mm.shape == (72, 2) and patch.area_mm2 == pytest.approx(6 * module.area_mm2)
    assert patch.inside(patch.centres_mm, margin_mm=2.2).all()
    first, second = patch.centres_mm[:12], patch.centres_mm[12:24]
    side = np.array([np.cos(np.pi / 3), np.sin(np.pi / 3)])  # that modules 1 and 2 share
    assert np.allclose((first + second) / 2, ((first + second) / 2 @ side)[:, None] * side)
    assert np.allclose(np.linalg.norm(first, axis=1), np.linalg.norm(second, axis=1))


def test_a_smaller_pitch_draws_taxels_together():
    near = module_layout(pitch_mm=4.5)
    assert np.linalg.norm(near.centres_mm[1] - near.centres_mm[2]) == pytest.approx(4.5)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"pitch_mm": 4.3}, r"taxels \d+ and \d+ are 4.3 mm apart and need more than 4.4 mm"),
        ({"pitch_mm": 6.0}, r"taxel \d+ at .* leaves the module by"),
        ({"guard_radius_mm": 2.0}, "guard and taxel touch"),
        ({"centres_mm": [(15, 0)]}, r"taxel 1 at \(15, 0\) mm leaves the module by 2.2 mm"),
    ],
)
def test_taxels_that_overlap_or_leave_the_module_are_refused(options, said):
    with pytest.raises(InputError, match=said):
        module_layout(**options)
