"""The constants that the paper prints in its table 1, as {(material, law): constants}; MPa and 1."""

TABLE_1 = {
    ("neoprene", "ogden2"): {"mu1": 0.0027, "alpha1": 8.74091, "mu2": 0.0551, "alpha2": 0.3889},
    ("neoprene", "mooney_rivlin"): {"c10": 0.1786, "c01": 0.0022},
    ("polyurethane", "ogden2"): {"mu1": 0.1351, "alpha1": 1.4538, "mu2": 0.2223, "alpha2": -4.9910},
    ("polyurethane", "mooney_rivlin"): {"c10": 0.1706, "c01": 0.0040},
}
