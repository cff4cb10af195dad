"""The elastomers that a skin can be made of: their compression curves, as data files with sources."""

import warnings
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, PositiveFloat, ValidationError
from scipy.optimize import brentq

from softtact.errors import ExtrapolationWarning, InputError
from softtact.files import read_yaml
from softtact.sensors.fields import FiniteSection
from softtact.unknown_names import first_fault, nearest

DATA = Path(str(resources.files("softtact.skin"))) / "data"
STRAINS = (0.05, 0.30)  # static strains of the tests: Le, Maiolino, Mastrogiovanni and Cannata, sec. III-A
STRESS_MPA = 0.055  # highest stress of any test, the same place
_BEYOND = 2.0  # times the highest tested stress: no curve is extrapolated further


class Elastomer(FiniteSection):
    """One compound; strain(stress) is compressive and a polynomial."""

    name: str
    strain_percent: tuple[float, float, float, float]
    density_g_cm3: PositiveFloat
    poisson: Annotated[float, Field(gt=-1, lt=0.5)]
    permittivity: PositiveFloat
    permittivity_fe: PositiveFloat
    young_gentle_mpa: PositiveFloat | None = None
    young_manipulation_mpa: PositiveFloat | None = None

    @cached_property
    def tested_mpa(self) -> tuple[float, float]:
        """Lowest and highest stress of the test: where the curve reaches the tested strains, and at most 55 kPa."""
        at = [self._stress_at(strain) for strain in STRAINS]
        return at[0], min(at[1], STRESS_MPA)

    def strain(self, stress_mpa: float) -> float:
        """Compressive strain at a stress in MPa, with an `ExtrapolationWarning` outside of the test.

        Below the lowest tested stress it is proportional to the stress: the polynomial does not pass through zero, and would give
        some per cent without any stress. Raises InputError beyond twice the highest tested stress, and where the polynomial gives
        no strain above zero.
        """
        low, high = self.tested_mpa
        if stress_mpa > _BEYOND * high:
            raise InputError(
                f"elastomer {self.name}: its curve was tested up to {1e3 * high:.3g} kPa, and {1e3 * stress_mpa:.3g} kPa is "
                "beyond twice that; choose less pressure or a stiffer elastomer."
            )
        strain = float(self.fit(stress_mpa)) if stress_mpa >= low else float(self.fit(low)) * stress_mpa / low
        if strain <= 0 or low == 0:
            raise InputError(
                f"elastomer {self.name}: its curve has a strain of {strain:.2%} at {1e3 * stress_mpa:.3g} kPa and "
                f"{float(self.fit(0.0)):.2%} without stress; correct strain_percent."
            )
        if not low <= stress_mpa <= high:
            beyond = "its curve is extrapolated" if stress_mpa > high else "its modulus is held as at the lowest tested stress"
            warnings.warn(
                f"elastomer {self.name}: {1e3 * stress_mpa:.3g} kPa is outside of its test from {1e3 * low:.3g} to "
                f"{1e3 * high:.3g} kPa (strains of 5 to 30 %, 55 kPa at most), so that {beyond}.",
                ExtrapolationWarning,
                stacklevel=2,
            )
        return strain

    def young_mpa(self, stress_mpa: float) -> float:
        """Secant modulus, stress over strain, at a stress in MPa; see `strain`."""
        return stress_mpa / self.strain(stress_mpa)

    def tested_young_mpa(self, stress_mpa: float) -> float:
        """`young_mpa` without warnings."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExtrapolationWarning)
            return self.young_mpa(stress_mpa)

    def fit(self, stress_mpa: Any) -> Any:
        """The polynomial's strain at a stress or an array of stresses, within the test and outside."""
        return 0.01 * np.polynomial.polynomial.polyval(stress_mpa, self.strain_percent)

    def _stress_at(self, strain):
        stress = np.linspace(0.0, 0.1, 401)
        above = np.flatnonzero(self.fit(stress) >= strain)
        if not len(above):
            return 0.1
        return 0.0 if above[0] == 0 else float(brentq(lambda s: self.fit(s) - strain, stress[above[0] - 1], stress[above[0]]))


def read_elastomers(path: str | Path | None = None) -> dict[str, Elastomer]:
    """Elastomers by name: the shipped ones, and those of a user's file, which add to them or replace them."""
    found: dict[str, Elastomer] = {}
    for file in [DATA / "elastomers.yaml", *([Path(path)] if path else [])]:
        values = read_yaml(file, missing="there is no such file of elastomers; correct `elastomers`.")
        if not isinstance(values, dict) or not isinstance(values.get("elastomers"), list):
            raise InputError(f"{file}: a file of elastomers holds a list `elastomers`; write it like {DATA / 'elastomers.yaml'}.")
        for number, entry in enumerate(values["elastomers"], start=1):
            try:
                elastomer = Elastomer.model_validate(entry)
            except ValidationError as error:
                fault = first_fault(error)
                given = "" if isinstance(fault["input"], dict) else f" (it is {fault['input']!r:.60})"
                raise InputError(f"{file}, elastomer {number}, at {'.'.join(map(str, fault['loc']))!r}{given}: {fault['msg']}; "
                                 "correct it.") from None
            found[elastomer.name] = elastomer
    return found


def find_elastomer(name: str, known: dict[str, Elastomer], *, where: str) -> Elastomer:
    """The elastomer of a name; an unknown one is refused with the nearest."""
    if name not in known:
        raise InputError(f"{where}: there is no elastomer {name!r}{nearest(name, known)}; known are {', '.join(known)}.")
    return known[name]


def fingertip_area_mm2(task: str) -> float:
    """Average contact area of a fingertip at a task as printed: cellphone, keyboard or mouse."""
    known = read_yaml(DATA / "fingertips.yaml", missing="the package is not complete; install it again.")
    if task not in known:
        raise InputError(f"load: there is no fingertip task {task!r}; use {', '.join(known)}.")
    return float(known[task]["average_mm2"])
