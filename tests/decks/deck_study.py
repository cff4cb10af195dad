"""What the deck tests share: a small sensor's body, a unit cell, and a run of ccx."""

import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from softtact.materials.laws.registry import make_law

needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")


class Tables:
    """The tables of a .dat file: `of(name)` gives one array (rows, columns) per step, in the order of the steps."""

    def __init__(self, path):
        self._tables = {}
        for block in re.split(r"\n(?= (?:displacements|total force|forces))", path.read_text()):
            head, *rows = block.strip().splitlines() or [""]
            name = re.search(r"for set (\S+) and time", head)
            if name:
                values = np.array([[float(text) for text in row.split()] for row in rows if row.strip()])
                self._tables.setdefault(name[1], []).append(values)

    def of(self, name):
        return self._tables[name]

    @property
    def force(self):
        """Force (N) on the object after each step."""
        return np.array([-table[0, 2] for table in self.of("OBJECT_NODES")])

    @property
    def indentation(self):
        """Lowering (mm) of the object after each step."""
        return np.array([-table[0, 3] for table in self.of("OBJECT_REFERENCE")])


def run_ccx(path):
    """Run ccx on a deck and return its `Tables`."""
    done = subprocess.run(["ccx", path.stem], cwd=path.parent, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout[-2000:]
    return Tables(path.with_suffix(".dat"))


def gaussian_chains(shear_modulus):
    """neo-Hooke written as Arruda-Boyce of hardly limited chains, K = 20 mu.

    It is the one law whose volumetric energy in Abaqus and ccx, K/2 ((J^2 - 1)/2 - ln J), is that of our pointwise share.
    """
    return make_law("arruda_boyce", {"mu": shear_modulus, "lambda_m": 100.0}, bulk_modulus=20 * shear_modulus)


def sharp(body):
    """The body with the contact law of a CalculiX deck: no smooth start of 0.001 mm."""
    body.support.contact, body.slab.top.contact = (replace(part.contact, smoothing=2e-5) for part in (body.support, body.slab.top))
    return body
