"""The two papers' claims on robot skin, by the rows of the study."""

import pytest

from softtact.evaluation.decisions import CONTRADICTION, MEASUREMENTS, REPRODUCED
from softtact.skin.elastomers import read_elastomers
from softtact.studies.skin.claims import claims_of_skin


@pytest.mark.slow
def test_the_claims_have_these_verdicts_and_the_meshes_converge():
    claims, meshes = claims_of_skin(read_elastomers())
    assert claims.verdict.value_counts().to_dict() == {REPRODUCED: 6, CONTRADICTION: 4, MEASUREMENTS: 3}
    field = meshes[meshes.of == "field"]
    steps = field.capacitance_ff.diff().abs().to_numpy()[1:]
    assert (steps < 0.003 * field.capacitance_ff.iloc[-1]).all() and steps[-1] < 0.001 * field.capacitance_ff.iloc[-1]
    assert field.delta_ff.max() / field.delta_ff.min() < 1.005     # what a load adds hardly depends on the mesh
