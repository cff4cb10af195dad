"""Write what the package ships of its sensors' fast models: the laws of their frusta, each of which takes a new user half a minute.

    python scripts/write_prepared.py

Run it after a change of a sensor, of its materials, or of what computes the laws; then `_FORMAT` in softtact/press/cache.py needs a
new number, too. Files of other values are removed. `pytest -m slow tests/press/test_shipped_models.py` compares the files with laws
made anew.
"""

import numpy as np

import softtact
from softtact.files import atomic_path
from softtact.models.foundation.frustum_spring import frustum_law
from softtact.press.cache import SHIPPED, shipped_frustum_law
from softtact.sensors.library import known_names


def frustum_files():
    """The file of the law of each sensor of the package that has frusta, with the sensor."""
    sensors = [softtact.load_sensor(name) for name in known_names("sensors")]
    return {shipped_frustum_law(one.spec, one.laws["dielectric"]): one for one in sensors
            if getattr(one.spec, "frusta_counts", None)}


def main():
    """Write the files that are missing, and remove others."""
    SHIPPED.mkdir(exist_ok=True)
    files = frustum_files()
    for path, sensor in files.items():
        if not path.exists():
            with atomic_path(path) as temporary:
                np.savez_compressed(temporary, **frustum_law(sensor.spec, sensor.laws["dielectric"]).arrays())
        print(f"{path.name}: {sensor.spec.name}, {path.stat().st_size / 1e3:.0f} kB")
    for path in set(SHIPPED.glob("*.npz")) - set(files):
        path.unlink()


if __name__ == "__main__":
    main()
