"""What the package ships of its sensors' fast models is what would be computed, and is used for these values alone."""

import shutil

import numpy as np
import pytest
from write_prepared import draft_files, frustum_files

from softtact.models.elastic.compliance import Compliance, draft_cells, elastic_compliance
from softtact.models.foundation.frustum_spring import FrustumLaw, frustum_law
from softtact.press import cache
from softtact.sensors.frusta import Friction

FILES = frustum_files()
ROUND_OFF = 1e-6     # relative, of what no iteration ends
# Load steps of a frustum's law end at 3e-4 of the force, so a processor that rounds otherwise may do an iteration more. Between two
# kinds compressions differ by up to 1.0e-3 of themselves, stiffnesses by 1.7e-4 of the largest.
OF_COMPRESSIONS, OF_STIFFNESSES = 2e-3, 5e-4
SENSORS = pytest.mark.parametrize("path", FILES, ids=[sensor.spec.name for sensor in FILES.values()])


@pytest.fixture
def computed(tmp_path, monkeypatch):
    """The sensors whose frusta's law was computed, in place of computing it; the user's cache is empty."""
    specs = []
    law = FrustumLaw.load(next(iter(FILES)))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(cache, "frustum_law", lambda spec, _: specs.append(spec) or law)
    cache._warn.cache_clear()
    return specs


@SENSORS
def test_the_frusta_of_the_packages_sensors_need_no_computing(path, computed):
    sensor = FILES[path]
    law = cache.cached_frustum_law(sensor.spec, sensor.laws["dielectric"])
    np.testing.assert_array_equal(law.force_n, FrustumLaw.load(path).force_n)
    assert not computed


def test_a_law_that_was_shipped_for_other_values_is_not_used(computed):
    sensor = next(one for one in FILES.values() if one.spec.name == "coro")
    laws, frusta = sensor.laws, sensor.spec.dielectric.frusta.model_copy(update={"height_mm": 0.51})
    higher = sensor.spec.model_copy(update={"dielectric": sensor.spec.dielectric.model_copy(update={"frusta": frusta})})
    sliding = sensor.spec.model_copy(update={"tips_bonded": False, "friction": Friction(board=0.3)})
    for spec, law in [(higher, laws["dielectric"]), (sliding, laws["dielectric"]), (sensor.spec, laws["cover"])]:
        cache.cached_frustum_law(spec, law)
    assert computed == [higher, sliding, sensor.spec]


def test_a_damaged_file_of_the_package_is_replaced_in_the_users_cache(tmp_path, monkeypatch, computed):
    path, sensor = next(iter(FILES.items()))
    monkeypatch.setattr(cache, "SHIPPED", tmp_path / "shipped")
    damaged = tmp_path / "shipped" / path.name
    damaged.parent.mkdir()
    shutil.copy(path, damaged)
    content = bytearray(damaged.read_bytes())
    content[1000] ^= 1
    damaged.write_bytes(content)
    for _ in range(2):
        cache.cached_frustum_law(sensor.spec, sensor.laws["dielectric"])
    assert len(computed) == 1


def test_the_drafts_of_the_packages_sensors_need_no_computing(computed, monkeypatch):
    monkeypatch.setattr(cache, "elastic_compliance", lambda spec, **_: pytest.fail(f"{spec.name}: computed"))
    for path, sensor in draft_files().items():
        np.testing.assert_array_equal(cache.cached_draft(sensor.spec).blocks.blocks, Compliance.load(path).blocks.blocks)


@pytest.mark.parametrize("path", [pytest.param(path, id=sensor.spec.name, marks=[pytest.mark.slow] * (sensor.spec.name != "pad"))
                                  for path, sensor in draft_files().items()])
def test_a_draft_that_is_shipped_is_the_one_that_is_computed(path):
    spec = draft_files()[path].spec
    made = elastic_compliance(spec, cells=draft_cells(spec)).blocks.blocks
    np.testing.assert_allclose(Compliance.load(path).blocks.blocks, made, rtol=0, atol=ROUND_OFF * made.max())


@SENSORS
@pytest.mark.parametrize("forces", [2, pytest.param(None, marks=pytest.mark.slow)], ids=["small forces", "all forces"])
def test_a_law_that_is_shipped_is_the_one_that_is_computed(path, forces):
    shipped, sensor = FrustumLaw.load(path).arrays(), FILES[path]
    reached = {} if forces is None else {"pressure_mpa": shipped["force_n"][forces] / sensor.spec.dielectric.frusta.pitch_mm**2}
    made = frustum_law(sensor.spec, sensor.laws["dielectric"], **reached).arrays()
    for name, expected in shipped.items():
        allowed = ROUND_OFF * np.abs(expected).max()
        if name in ("force_n", "compression_mm"):
            expected = expected[:len(made[name])]
        if name == "compression_mm":
            allowed = OF_COMPRESSIONS * expected
        elif name in ("lateral_at_mm", "stiffness"):      # at shares of the largest compression
            if forces:
                continue
            allowed = OF_STIFFNESSES * np.abs(expected).max()
        assert (np.abs(made[name] - expected) <= allowed).all(), name
