"""Write what the package ships of its sensors' fast models: the laws of their frusta, each of which takes a new user half a minute,
and drafts of their elastic layers, for the first map in `softtact play`.

    python scripts/write_prepared.py

Run it after a change of a sensor, of its materials, or of what computes the laws; then `_FORMAT` in softtact/press/cache.py needs a
new number, too. Files of other values are removed. tests/press/test_shipped_models.py compares the files with what is made anew:
small forces and the smaller draft in each run of the tests, all of them with `-m slow`.
"""

import numpy as np

import softtact
from softtact.files import atomic_path
from softtact.models.elastic.compliance import draft_cells, elastic_compliance
from softtact.models.foundation.frustum_spring import frustum_law
from softtact.press.cache import SHIPPED, shipped_draft, shipped_frustum_law
from softtact.sensors.library import known_names


def sensors():
    """The package's sensors with frusta."""
    every = [softtact.load_sensor(name) for name in known_names("sensors")]
    return [one for one in every if getattr(one.spec, "frusta_counts", None)]


def frustum_files():
    """The file of the law of each sensor's frusta, with the sensor."""
    return {shipped_frustum_law(one.spec, one.laws["dielectric"]): one for one in sensors()}


def draft_files():
    """The file of the draft of each sensor's elastic layer, with the sensor."""
    return {shipped_draft(one.spec): one for one in sensors()}


def main():
    """Write the files that are missing, and remove others."""
    SHIPPED.mkdir(exist_ok=True)
    laws, drafts = frustum_files(), draft_files()
    for path, sensor in (laws | drafts).items():
        if not path.exists():
            with atomic_path(path) as temporary:
                if path in laws:
                    np.savez_compressed(temporary, **frustum_law(sensor.spec, sensor.laws["dielectric"]).arrays())
                else:
                    elastic_compliance(sensor.spec, cells=draft_cells(sensor.spec)).save(temporary)
        print(f"{path.name}: {sensor.spec.name}, {path.stat().st_size / 1e3:.0f} kB")
    for path in set(SHIPPED.glob("*.npz")) - set(laws | drafts):
        path.unlink()


if __name__ == "__main__":
    main()
