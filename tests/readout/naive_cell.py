"""Capacitance of one frustum's cell by finite volumes: the slow, plain way to what `sensing.capacitance` bounds."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve


def cell_capacitance(spec, displacement_mm, *, across=100, up=120):
    """pF/mm2 of a round cell of the lattice cell's area, its frustum shorter and wider at the same volume; no full pocket."""
    d, f = spec.dielectric, spec.dielectric.frusta
    radius, stretch = f.pitch_mm / np.sqrt(np.pi), 1 - displacement_mm / f.height_mm
    height = f.height_mm * stretch + d.sheet_thickness_mm
    dr, dz = radius / across, height / up
    r, z = (np.arange(across) + 0.5) * dr, (np.arange(up) + 0.5) * dz
    cone = 0.5 * (f.tip_diameter_mm + (f.root_diameter_mm - f.tip_diameter_mm) * np.minimum(z / (stretch * f.height_mm), 1))
    solid = (r[:, None] < cone / np.sqrt(stretch)) | (z > stretch * f.height_mm)
    permittivity = np.where(solid, d.relative_permittivity, 1.0)                                      # (r, z)
    outer, upper = (2 / (1 / permittivity[part] + 1 / permittivity[other])
                    for part, other in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])))                # between cells
    number = np.arange(across * up).reshape(across, up)
    ring = 2 * np.pi * r[:, None] * dr
    pairs = [(number[1:], number[:-1], outer * 2 * np.pi * (r[:-1, None] + 0.5 * dr) * dz / dr),
             (number[:, 1:], number[:, :-1], upper * ring / dz)]
    i, j, c = (np.concatenate([np.ravel(pair[k]) for pair in pairs]) for k in range(3))
    plates = [(number[:, 0], 2 * permittivity[:, 0] * ring[:, 0] / dz), (number[:, -1], 2 * permittivity[:, -1] * ring[:, 0] / dz)]
    diagonal = np.zeros(number.size)
    for index, conductance in [(i, c), (j, c), *plates]:
        np.add.at(diagonal, index, conductance)
    every = np.arange(number.size)
    matrix = coo_matrix((np.concatenate([diagonal, -c, -c]), (np.concatenate([every, i, j]), np.concatenate([every, j, i]))))
    source = np.zeros(number.size)
    source[plates[1][0]] = plates[1][1]                                                              # upper plate at 1 V
    voltage = spsolve(matrix.tocsc(), source)
    return 8.8541878128e-3 * (plates[0][1] * voltage[plates[0][0]]).sum() / (np.pi * radius**2)


def column_capacitance(spec, displacement_mm, *, count=4000):
    """pF/mm2 of the same cell with straight field lines: columns of air and solid, each in series, side by side."""
    d, f = spec.dielectric, spec.dielectric.frusta
    stretch = 1 - displacement_mm / f.height_mm
    tip, root = 0.5 * f.tip_diameter_mm / np.sqrt(stretch), 0.5 * f.root_diameter_mm / np.sqrt(stretch)
    radius = f.pitch_mm / np.sqrt(np.pi) * np.sqrt((np.arange(count) + 0.5) / count)                  # of rings of one area
    air = stretch * f.height_mm * np.clip((radius - tip) / (root - tip), 0, 1)
    solid = stretch * f.height_mm + d.sheet_thickness_mm - air
    return 8.8541878128e-3 * np.mean(1 / (air + solid / d.relative_permittivity))
