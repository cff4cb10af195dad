"""A design with what its names mean, checked before any work begins."""

import warnings
from dataclasses import dataclass
from pathlib import Path

from softtact.errors import ExtrapolationWarning, InputError
from softtact.geometry.meshes import read_mesh
from softtact.skin.choice import Needs
from softtact.skin.converter import Converter
from softtact.skin.design import Choice, Design
from softtact.skin.elastomers import Elastomer, find_elastomer, read_elastomers
from softtact.skin.layout import Layout, module_layout
from softtact.skin.loads import Load, disc, refuse_beside


@dataclass
class Study:
    """A design with what its names mean, all checked before any work begins."""

    design: Design
    where: str
    """The design's file."""
    layout: Layout
    elastomers: dict[str, Elastomer]
    elastomer: Elastomer
    converter: Converter
    loads: dict[str, Load | None]
    """By name; None for a mesh, which has no forces before it is pressed."""


def prepare(design: Design, path: Path) -> Study:
    """Check a design as far as that takes no time; the first fault is an InputError."""
    where, layout, folder = str(path), design.layout(), path.parent
    elastomers = read_elastomers(folder / design.elastomers if design.elastomers else None)
    elastomer = find_elastomer(design.elastomer, elastomers, where=f"{where}, at 'elastomer'")
    loads = {load.name: None if load.mesh else load.pressure(layout, folder=folder, where=where) for load in design.loads}
    pressures = {f"load {name!r}": [load.pressure_mpa] for name, load in loads.items() if load is not None}
    if design.probes:
        pressures["at 'probes.pressures_kpa'"] = [1e-3 * pressure for pressure in design.probes.pressures_kpa]
    if design.maps:
        pressures["at 'maps.pressure_kpa'"] = [1e-3 * design.maps.pressure_kpa]
    _refuse_pressures(elastomer, pressures, where)
    _refuse_places(design, layout, folder, where)
    _refuse_choice(design, elastomers, where)
    _refuse_search(design, elastomers, where)
    return Study(design, where, layout, elastomers, elastomer, design.converter.converter(where), loads)


def needs_of(choice: Choice) -> Needs:
    """What a layer has to do, in MPa, mm and N."""
    low, high = (1e-3 * value for value in choice.range_kpa)
    return Needs((low, high), choice.probe_mm, choice.smallest_force_n, choice.detected_counts, choice.strain_limit)


def bears(elastomer: Elastomer, stress_mpa: float) -> bool:
    """Whether an elastomer's curve reaches a stress."""
    try:
        elastomer.tested_young_mpa(stress_mpa)
    except InputError:
        return False
    return True


def reaches(elastomer: Elastomer, stress_mpa: float) -> bool:
    """Whether an elastomer's curve has a strain at a stress, extrapolated or not."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExtrapolationWarning)
            return elastomer.strain(stress_mpa) < 1
    except InputError:
        return False


def _refuse_choice(design, elastomers, where):
    """Refuse a choice at pressures that no elastomer's curve reaches, or in a range that does not rise."""
    if design.choice is None:
        return
    low, high = design.choice.range_kpa
    if low >= high:
        raise InputError(f"{where}, at 'choice.range_kpa': {low:g} to {high:g} kPa does not rise; write the lower pressure first.")
    for name, pressure, check in (("target_kpa", design.choice.target_kpa, reaches), ("range_kpa", high, bears)):
        if not any(check(elastomer, 1e-3 * pressure) for elastomer in elastomers.values()):
            raise InputError(f"{where}, at 'choice.{name}': no elastomer's curve reaches {pressure:g} kPa; choose less pressure.")


def _refuse_pressures(elastomer, pressures, where):
    """Refuse pressures {place: [MPa]} that the elastomer's curve does not reach."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ExtrapolationWarning)
        for place, values in pressures.items():
            for value in values:
                try:
                    elastomer.strain(value)
                except InputError as error:
                    raise InputError(f"{where}, {place}: {error}") from None


def _refuse_places(design, layout, folder, where):
    """Refuse meshes that cannot be read, and probes without a taxel or beside the elastomer."""
    for load in design.loads:
        load.centre(layout, where)
        if load.mesh:
            read_mesh(folder / load.mesh, unit=load.unit)
    if design.link:
        read_mesh(folder / design.link.mesh, unit=design.link.unit)
    if design.probes is None:
        return
    if design.probes.at_taxel > len(layout.centres_mm):
        raise InputError(f"{where}, at 'probes.at_taxel': there is no taxel {design.probes.at_taxel}; give one of 1 to "
                         f"{len(layout.centres_mm)}.")
    x, y = layout.centres_mm[design.probes.at_taxel - 1]
    for diameter in design.probes.diameters_mm:
        load = disc((float(x), float(y)), diameter_mm=diameter, pressure_mpa=1e-3)
        refuse_beside(load, layout, where=f"{where}, at 'probes.diameters_mm', {diameter:g} mm")


def _refuse_search(design, elastomers, where):
    """Refuse unknown elastomers, and modules without place for their taxels."""
    if design.search is None:
        return
    for name in design.search.elastomers or ():
        find_elastomer(name, elastomers, where=f"{where}, at 'search.elastomers'")
    gap = design.module.guard_radius_mm - design.module.radius_mm
    for radius in design.search.radii_mm:
        for pitch in design.search.pitches_mm:
            try:
                module_layout(side_mm=design.module.side_mm, pitch_mm=pitch, radius_mm=radius, guard_radius_mm=radius + gap)
            except InputError as error:
                raise InputError(f"{where}, at 'search', radius {radius:g} and pitch {pitch:g} mm: {error}") from None
