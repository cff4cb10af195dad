"""Sensors and materials by name: a user's own in `config/` of the working folder first, then those that ship with the package.

    config/sensors/NAME.yaml, config/materials/NAME.yaml     a user's own; they add to what ships or replace it by their name
    softtact/sensors/data/                                   what ships
"""

from importlib import resources
from pathlib import Path

from softtact.errors import InputError
from softtact.unknown_names import nearest

SHIPPED = Path(str(resources.files("softtact.sensors"))) / "data"
OWN = Path("config")          # of the folder that a command runs in
ALIASES = {"sensors": {"tsf85": "coro"}, "materials": {}}     # a product's name, and the name that the sensor has in its papers
YAML = (".yaml", ".yml")


def sensor_file(name: str | Path, *, folder: str | Path = OWN) -> Path:
    """The YAML file of a sensor, given by its name or by the path of a YAML file.

    folder: the folder whose `sensors/` comes before what ships
    Raises InputError, which lists the known names, where there is no sensor of that name.
    """
    return _file("sensors", name, Path(folder))


def material_file(name: str | Path, *, folder: str | Path = OWN) -> Path:
    """The YAML file of a material, given by its name or by the path of a YAML file.

    folder: the folder whose `materials/` comes before what ships
    Raises InputError, which lists the known names, where there is no material of that name.
    """
    return _file("materials", name, Path(folder))


def known_names(kind: str, *, folder: str | Path = OWN) -> list[str]:
    """Sorted names of the `kind`, sensors or materials: a user's own, those that ship, and other names of those."""
    files = [path for place in _folders(kind, Path(folder)) for path in place.glob("*.yaml")]
    return sorted({*(path.stem for path in files), *ALIASES[kind]})


def is_shipped(path: str | Path) -> bool:
    """Whether a file is one of those that ship."""
    return Path(path).is_relative_to(SHIPPED)


def _folders(kind: str, folder: Path) -> tuple[Path, Path]:
    return folder / kind, SHIPPED / kind


def _file(kind: str, name: str | Path, folder: Path) -> Path:
    if Path(name).suffix in YAML:
        return Path(name)
    for asked in (str(name), ALIASES[kind].get(str(name), str(name))):
        for place in _folders(kind, folder):
            if asked in {path.stem for path in place.glob("*.yaml")}:     # by comparison: a name is no path
                return place / f"{asked}.yaml"
    known = known_names(kind, folder=folder)
    raise InputError(f"There is no {kind.removesuffix('s')} {str(name)!r}{nearest(name, known)}; known are {', '.join(known)}; "
                     f"write one of them, the path of a YAML file, or put yours at {folder / kind / f'{name}.yaml'}.")
