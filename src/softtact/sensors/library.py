"""Sensors and materials by name: first the user's in `config/` of the working folder, then those of the package.

    config/sensors/NAME.yaml, config/materials/NAME.yaml     of the user, in addition to those of the package or in their place
    softtact/sensors/data/                                   of the package
"""

from importlib import resources
from pathlib import Path

from softtact.errors import InputError
from softtact.unknown_names import nearest

SHIPPED = Path(str(resources.files("softtact.sensors"))) / "data"
OWN = Path("config")          # of the folder that a command runs in
ALIASES = {"sensors": {"tsf85": "coro"}, "materials": {}}     # a product's name: the sensor's name in its papers
YAML = (".yaml", ".yml")


def sensor_file(name: str | Path, *, folder: str | Path = OWN) -> Path:
    """The YAML file of a sensor, given by its name or by the path of a YAML file.

    folder: its `sensors/` comes before those of the package
    Raises InputError, which lists the known names, where there is no sensor of that name.
    """
    return _file("sensors", name, Path(folder))


def material_file(name: str | Path, *, folder: str | Path = OWN) -> Path:
    """The YAML file of a material, given by its name or by the path of a YAML file.

    folder: its `materials/` comes before those of the package
    Raises InputError, which lists the known names, where there is no material of that name.
    """
    return _file("materials", name, Path(folder))


def known_names(kind: str, *, folder: str | Path = OWN) -> list[str]:
    """Sorted names of the `kind`, sensors or materials: of the user, of the package, and aliases of these."""
    files = [path for place in _folders(kind, Path(folder)) for path in place.glob("*.yaml")]
    return sorted({*(path.stem for path in files), *ALIASES[kind]})


def is_shipped(path: str | Path) -> bool:
    """Whether a file is part of the package."""
    return Path(path).is_relative_to(SHIPPED)


def _folders(kind: str, folder: Path) -> tuple[Path, Path]:
    return folder / kind, SHIPPED / kind


def _file(kind: str, name: str | Path, folder: Path) -> Path:
    if Path(name).suffix in YAML:
        return Path(name)
    for stem in (str(name), ALIASES[kind].get(str(name), str(name))):
        for place in _folders(kind, folder):
            if stem in {path.stem for path in place.glob("*.yaml")}:     # compared as names: a name must not be a path
                return place / f"{stem}.yaml"
    known = known_names(kind, folder=folder)
    raise InputError(f"There is no {kind.removesuffix('s')} {str(name)!r}{nearest(name, known)}; known are {', '.join(known)}; "
                     f"write one of them, the path of a YAML file, or put yours at {folder / kind / f'{name}.yaml'}.")
