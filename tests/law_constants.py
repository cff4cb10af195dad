"""Constants of every law, and the order of the six components, for the tests of the laws."""

import numpy as np

PARAMETERS = {
    "neo_hooke": {"c10": 0.18},
    "mooney_rivlin": {"c10": 0.1706, "c01": 0.0040},
    "yeoh": {"c10": 0.18, "c20": -0.01, "c30": 0.004},
    "reduced_polynomial2": {"c10": 0.18, "c20": 0.02},
    "arruda_boyce": {"mu": 0.3, "lambda_m": 2.5},
    "gent": {"mu": 0.3, "jm": 15.0},
    "ogden1": {"mu1": 0.35, "alpha1": 3.3},
    "ogden2": {"mu1": 0.1351, "alpha1": 1.4538, "mu2": 0.2223, "alpha2": -4.9910},
    "ogden3": {"mu1": 0.4, "alpha1": 1.3, "mu2": 0.003, "alpha2": 5.0, "mu3": 0.02, "alpha3": -2.0},
}
ROW, COLUMN = [0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]
# dC of a unit step of E6 = [Exx, Eyy, Ezz, 2 Exy, 2 Eyz, 2 Ezx], with C = 1 + 2 E.
C_PER_E = np.array([2.0, 2.0, 2.0, 1.0, 1.0, 1.0])
