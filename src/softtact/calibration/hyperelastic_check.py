"""How far the hyperelastic model, which a calibration takes too long to fit by, lies from the calibrated sensor."""

from dataclasses import replace

import numpy as np

from softtact.calibration.fit import CalibrationResult
from softtact.calibration.ladder import COVERS, Presses, parabola, with_cover
from softtact.calibration.rubbing import with_friction
from softtact.errors import ConvergenceError
from softtact.progress import announce
from softtact.readout.calibrated import relative_change


def hyperelastic_differences(result: CalibrationResult) -> list[float | None]:
    """How far, in counts (root mean square), the hyperelastic model lies from the calibrated one at each press' largest force.

    That is the largest for which the calibrated one is valid. Both have the calibrated gains, moduli, cover, friction and places,
    and no creep. None where there is no valid force, or where the hyperelastic model does not reach it.
    """
    return [_difference(result, k) for k in range(len(result.problem.experiments))]


def _difference(result, k):
    problem, one = result.problem, result.problem.experiments[k]
    cover = problem.value(result.vector, "cover", 1.0)
    sensor, place = problem.presses.sensor, problem.place(result.vector, k)
    force = min(problem.valid_n[k], float(one.force_n.max()) / result.modulus_scale)
    if force == 0:
        return None
    announce(f"{one.name}: pressing by the hyperelastic model at {force:.3g} N")
    friction, spec = problem.value(result.vector, "friction", 0.0), with_cover(sensor.spec, cover)
    if "friction" in problem.names:
        spec = with_friction(spec, friction)
    calibrated = replace(sensor, spec=spec, prepared_models={})
    try:
        other = Presses(calibrated, model="hyperelastic", levels=1).ladder(one.mesh, place, largest_n=force).maps_mm[-1]
    except ConvergenceError:
        return None
    shares = parabola(COVERS, cover) if "cover" in problem.names else {1.0: 1.0}
    own = sum(share * problem.presses.ladder(one.mesh, place, largest_n=force, cover=variant).maps_mm[-1]
              for variant, share in shares.items())
    own = own + sum(share * np.tensordot(ladder.weights(np.array([force]))[0], ladder.maps_mm, 1)
                    for share, ladder in problem.rubbed(k, friction))
    apart = result.linear.gain * (relative_change(sensor.spec, other) - relative_change(sensor.spec, own))
    return float(np.sqrt(np.mean(apart**2)))
