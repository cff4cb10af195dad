"""Faces of a mesh by rules in words: `z<0.1` or `x>-3 & x<3 & z>2`, of the middles of the outer facets in mm."""

import re
from collections.abc import Callable, Mapping

import numpy as np

from softtact.errors import InputError
from softtact.fem.solid_mesh import SolidMesh

_TERM = re.compile(r"\s*([xyz])\s*([<>])\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*")


def face_rule(text: str) -> Callable[[np.ndarray], np.ndarray]:
    """Which middles (f, 3) in mm a rule takes, (f,) bool: comparisons of x, y or z with numbers in mm, all of which hold.

    Raises InputError that shows the form of a rule.
    """
    terms = [_TERM.fullmatch(part) for part in text.split("&")]
    if not all(terms):
        raise InputError(f"The rule {text!r} of a face is not understood; write comparisons in mm such as 'z<0.1' or 'x>-3 & x<3'.")
    limits = [("xyz".index(term[1]), -1.0 if term[2] == "<" else 1.0, float(term[3])) for term in terms if term]
    return lambda middles: np.all([sign * (middles[:, axis] - value) > 0 for axis, sign, value in limits], axis=0)


def with_named_faces(mesh: SolidMesh, rules: Mapping[str, str]) -> SolidMesh:
    """The mesh with faces {name: rule}. Raises InputError where a rule is not understood or a face would be empty."""
    return mesh.with_faces(**{name: face_rule(text) for name, text in rules.items()})
