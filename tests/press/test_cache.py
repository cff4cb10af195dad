"""What the fast models start from is computed anew where it would be another, and only there."""

import pytest
from support.sensors import CORO

from softtact.press import cache


class _Kept:
    def save(self, path):
        path.write_bytes(b"kept")

    @classmethod
    def load(cls, path):
        return cls()


def changed(spec, **values):
    """A sensor with other values, by the dotted names of its file."""
    data = spec.model_dump(mode="json")
    for name, value in values.items():
        *sections, last = name.split("__")
        section = data
        for key in sections:
            section = section[key]
        section[last] = value
    return type(spec).from_dict(data)


@pytest.fixture
def computed(tmp_path, monkeypatch):
    """The names of what was computed, in place of computing it."""
    names = []
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for name, kind in (("elastic_compliance", "Compliance"), ("foundation_compliance", "FoundationCompliance")):
        monkeypatch.setattr(cache, name, lambda *_, name=name, **__: names.append(name) or _Kept())
        monkeypatch.setattr(cache, kind, _Kept)
    return names


LAWS = {"dielectric": "a law", "cover": "a law"}
READOUT = [{"name": "other"}, {"largest_counts": 100.0}, {"taxels__rows": 3}, {"force_range_n": [0.0, 9.0]},
           {"dielectric__relative_permittivity": 2.0}, {"dielectric__material": "neoprene"}, {"edge__shell_width_mm": 5.0}]
FRUSTA = [{"dielectric__frusta__pitch_mm": 1.1}, {"dielectric__frusta__tip_diameter_mm": 0.5}, {"tips_bonded": False}]
BOTH = [{"footprint_mm": [22.0, 30.0]}, {"map_shape": [31, 33]}, {"cover__thickness_mm": 2.0}, {"edge__held": "free"}]


@pytest.mark.parametrize(("values", "anew"), [(one, 0) for one in [*READOUT, *FRUSTA]]
                         + [(one, 1) for one in [*BOTH, {"elastic_layer__young_mpa": 2.0}]])
def test_the_elastic_layer_is_computed_anew_for_its_own_values_alone(values, anew, computed):
    cache.cached_compliance(CORO)
    cache.cached_compliance(changed(CORO, **values))
    assert len(computed) == 1 + anew


@pytest.mark.parametrize(("values", "anew"), [(one, 0) for one in [*READOUT, {"elastic_layer__young_mpa": 2.0}]]
                         + [(one, 1) for one in [*FRUSTA, *BOTH]])
def test_the_slab_on_frusta_is_computed_anew_for_its_own_values_alone(values, anew, computed):
    cache.cached_foundation(CORO, LAWS)
    cache.cached_foundation(changed(CORO, **values), LAWS)
    cache.cached_foundation(CORO, LAWS | {"cover": "another law"})
    assert len(computed) == 2 + anew


def test_a_preparation_takes_no_time_once_it_is_there(computed):
    assert cache.seconds_to_prepare_foundation(CORO, LAWS) == pytest.approx(30.0)      # as much as the paper's own map
    large = changed(CORO, map_shape=[91, 91], footprint_mm=[60.0, 60.0])
    assert cache.in_words(cache.seconds_to_prepare_foundation(large, LAWS)) == "about 5 minutes"
    cache.cached_foundation(CORO, LAWS)
    assert cache.seconds_to_prepare_foundation(CORO, LAWS) == 0.0
