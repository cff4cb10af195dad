"""What the fast models start from is computed anew where it would be another, and only there."""

import errno
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from support.sensors import CORO

from softtact.files import read_arrays
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
    monkeypatch.setattr(cache, "cached_frustum_law", lambda *_: "a frustum's law")
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
    assert cache.in_words(cache.seconds_to_prepare_foundation(CORO, LAWS)) == "about 30 s"
    cache.cached_foundation(CORO, LAWS)
    assert cache.seconds_to_prepare_foundation(CORO, LAWS) == 0.0


@dataclass(frozen=True)
class _Numbers:
    """Prepared data of a few numbers."""

    values: np.ndarray

    def save(self, path):
        np.savez(path, values=self.values)

    @classmethod
    def load(cls, path):
        with read_arrays(path) as data:
            return cls(data["values"])


@pytest.fixture
def prepare(tmp_path, monkeypatch):
    """A function that takes the elastic layer from the cache, which is in a folder below tmp_path; it returns its numbers."""
    times = []
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "elastic_compliance", lambda *_, **__: times.append(1) or _Numbers(np.arange(100.0)))
    monkeypatch.setattr(cache, "Compliance", _Numbers)
    cache._warn.cache_clear()

    def prepare():
        np.testing.assert_array_equal(cache.cached_compliance(CORO).values, np.arange(100.0))
        return len(times)

    return prepare


def damaged(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def cut_off(path):
    path.write_bytes(path.read_bytes()[:200])


def of_other_data(path):
    np.savez(path, others=np.zeros(3))


@pytest.mark.parametrize("spoil", [damaged, cut_off, of_other_data])
def test_a_spoilt_file_of_the_cache_is_told_and_made_again(spoil, prepare, tmp_path, capsys):
    assert (prepare(), prepare()) == (1, 1)
    (file,) = (tmp_path / "cache/softtact").iterdir()
    spoil(file)
    assert (prepare(), prepare()) == (2, 2)
    told = capsys.readouterr().err
    assert told.count("WARNING") == 1 and f"WARNING: {file}: " in told and "It is computed again." in told


def a_file_in_its_place(folder, monkeypatch):
    folder.write_text("where the cache's folder should be")


def a_full_disk(folder, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(np, "savez", full)


def no_home(folder, monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(Path, "home", lambda: (_ for _ in ()).throw(RuntimeError("Could not determine home directory.")))


@pytest.mark.parametrize("fault", [a_file_in_its_place, a_full_disk, no_home])
def test_a_cache_that_cannot_be_written_stops_no_press_and_is_told_once(fault, prepare, tmp_path, monkeypatch, capsys):
    fault(tmp_path / "cache", monkeypatch)
    assert (prepare(), prepare()) == (1, 2)
    told = capsys.readouterr().err
    assert told.count("WARNING") == 1 and "set XDG_CACHE_HOME to a folder with room" in told
