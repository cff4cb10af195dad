"""Prepared data of a sensor's fast models, computed once for a sensor and kept in the user's cache.

What is small and takes long is shipped for the package's own sensors, under the same names (`scripts/write_prepared.py`): a name is
the digest of the values that its contents depend on, so another geometry or material never finds it.
"""

import contextlib
import math
from collections.abc import Mapping
from functools import cache
from importlib import resources
from pathlib import Path

from softtact.checksums import check, seal
from softtact.errors import InputError, OutputError, SofttactError
from softtact.files import atomic_path, digest
from softtact.materials.laws.base import Law
from softtact.models.elastic.compliance import Compliance, DraftCompliance, draft_cells, draft_of, elastic_compliance
from softtact.models.elastic.tangential import SurfaceCompliance, surface_compliance
from softtact.models.foundation.compliance import FoundationCompliance, foundation_compliance
from softtact.models.foundation.frustum_spring import FrustumLaw, frustum_law
from softtact.outputs import cache_folder
from softtact.progress import announce
from softtact.sensors.frusta import Friction, SensorSpec
from softtact.sensors.specification import AnySpec

SHIPPED = Path(str(resources.files("softtact.press"))) / "data"
_POINTS = 1881  # of the paper's map
_FOUNDATION_TAKES = 30, 1.5     # seconds for the paper's map, which grow with this power of the number of a map's points
_ELASTIC_TAKES = 6, 2.0     # the same of the elastic model, on one core
_FRUSTUM_TAKES = 20     # seconds
_FORMAT = 12    # of the files; a new number computes them again


def _of_layer(spec):
    """The values on which a sensor's elastic layer depends: not its name, frusta, taxels or friction."""
    return [spec.footprint_mm, spec.map_shape, spec.thickness_mm, repr(spec.elastic_layer), spec.edge.held_below_mm, spec.base_held]


def _of_frusta(spec):
    """The values on which a sensor's slab on frusta depends, in addition to the laws."""
    return [spec.footprint_mm, spec.map_shape, repr(spec.dielectric.frusta), spec.dielectric.sheet_thickness_mm,
            spec.cover.thickness_mm, spec.edge.held_below_mm, spec.tips_bonded, repr(spec.friction)]


def cached_compliance(spec: AnySpec, *, threads: int = 1) -> Compliance:
    """The elastic layer's `Compliance`; cached by the values that it depends on."""
    return _cached("compliance", _of_layer(spec), Compliance,
                   f"{spec.name}: computing the elastic layer's compliance, once for this sensor ({_about(spec, *_ELASTIC_TAKES)})",
                   lambda: elastic_compliance(spec, threads=threads))


def cached_draft(spec: AnySpec, *, threads: int = 1) -> DraftCompliance:
    """The elastic layer's `DraftCompliance`, in a fifth of the time; shipped, or cached by the values that it depends on."""
    return draft_of(spec, _cached("draft", _of_draft(spec), Compliance,
                                  f"{spec.name}: computing a draft of the elastic layer's compliance, once for this sensor",
                                  lambda: elastic_compliance(spec, threads=threads, cells=draft_cells(spec))))


def shipped_draft(spec: AnySpec) -> Path:
    """Where the package has the `Compliance` of a sensor's `cached_draft`, if it has it."""
    return SHIPPED / _name("draft", _of_draft(spec))


def _of_draft(spec):
    return [*_of_layer(spec), draft_cells(spec)]


def cached_surface_compliance(spec: AnySpec, *, threads: int = 1) -> SurfaceCompliance:
    """The elastic layer's `SurfaceCompliance`; cached by the values that it depends on."""
    return _cached("surface", _of_layer(spec), SurfaceCompliance,
                   f"{spec.name}: computing the elastic layer's compliance to forces in all directions, once for this sensor "
                   f"({_about(spec, 12, 2.0)}; 230 MB for the paper's)",
                   lambda: surface_compliance(spec, threads=threads))


def cached_foundation(spec: SensorSpec, laws: Mapping[str, Law], *, threads: int = 1) -> FoundationCompliance:
    """The `FoundationCompliance` of a sensor with its laws {"dielectric", "cover"}; cached by the values that it depends on."""
    return _cached("foundation", _of_foundation(spec, laws), FoundationCompliance,
                   f"{spec.name}: computing the slab's compliance, once for this sensor and these laws "
                   f"({_about(spec, *_FOUNDATION_TAKES)})",
                   lambda: foundation_compliance(spec, dielectric_law=laws["dielectric"], cover_law=laws["cover"],
                                                 frustum=cached_frustum_law(spec, laws["dielectric"]), threads=threads))


def cached_frustum_law(spec: SensorSpec, law: Law, *, bonded: bool = False) -> FrustumLaw:
    """The `FrustumLaw` of a sensor's frusta; shipped, or cached by the values that it depends on.

    bonded: of frusta whose tips are held, whatever those of the sensor are
    """
    if bonded:
        spec = spec.model_copy(update={"tips_bonded": True, "friction": Friction()})
    return _cached("frustum", _of_frustum(spec, law), FrustumLaw,
                   f"{spec.name}: computing the law of a frustum, once for frusta of this kind ({in_words(_FRUSTUM_TAKES)})",
                   lambda: frustum_law(spec, law))


def shipped_frustum_law(spec: SensorSpec, law: Law) -> Path:
    """Where the package has the `FrustumLaw` of a sensor's frusta, if it has it."""
    return SHIPPED / _name("frustum", _of_frustum(spec, law))


def _of_frustum(spec, law):
    return [repr(spec.dielectric.frusta), spec.dielectric.sheet_thickness_mm, spec.tips_bonded, repr(spec.friction), repr(law)]


def seconds_to_prepare_foundation(spec: SensorSpec, laws: Mapping[str, Law]) -> float:
    """Estimated time of `cached_foundation` on two cores; 0 if it is cached."""
    return 0.0 if _files("foundation", _of_foundation(spec, laws)) else _seconds(spec, *_FOUNDATION_TAKES)


def _of_foundation(spec, laws):
    return [*_of_frusta(spec), repr(laws["dielectric"]), repr(laws["cover"])]


def in_words(seconds: float) -> str:
    """A time that a preparation takes, roughly."""
    return f"about {seconds / 60:.0f} minutes" if seconds > 90 else f"about {5 * math.ceil(seconds / 5)} s"


def _about(spec, seconds, power):
    return f"{in_words(_seconds(spec, seconds, power))} on an idle machine"


def _seconds(spec, seconds, power):
    """Estimated time: `seconds` for the paper's sensor, scaled by a power of the number of the map's points."""
    return seconds * (math.prod(spec.map_shape) / _POINTS) ** power


def _name(kind, values):
    return f"{kind}-{digest([_FORMAT, *values])}.npz"


def _files(kind, values):
    """The files with these values, of which there may be one in the package and one in the user's cache."""
    folders = [SHIPPED]
    with contextlib.suppress(OutputError):
        folders.append(cache_folder())
    return [path for folder in folders if (path := folder / _name(kind, values)).exists()]


def _cached(kind, values, cls, message, compute):
    """The prepared data of a file; computed, with a word, where the file is missing or damaged, and kept where that is possible."""
    for path in _files(kind, values):
        try:
            _seal(path)
            return cls.load(path)
        except InputError as error:
            _warn(f"{error} It is computed again.")
    announce(message)
    prepared = compute()
    try:
        path = cache_folder() / _name(kind, values)
        with atomic_path(path) as temporary:
            prepared.save(temporary)
        return cls.load(path)
    except (SofttactError, OSError) as error:
        _warn(f"What was computed is not kept ({str(error).partition(';')[0].rstrip('.')}), so the next run computes it again; set "
              "XDG_CACHE_HOME to a folder with room in which files can be written.")
    return prepared


def _seal(path):
    """Add a checksum to a file that an older version kept without."""
    with contextlib.suppress(OSError):
        if not check(path):
            seal(path)


@cache
def _warn(sentence):
    """Say a sentence on stderr, once."""
    announce(f"WARNING: {sentence}")
