"""The laws that the paper prints for the sensor's layers (its table 1, Mooney-Rivlin), as the tests take them."""

from softtact.materials.laws.registry import make_law

POLYURETHANE = make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040}, bulk_modulus=20 * 0.3492)     # of the dielectric
NEOPRENE = make_law("mooney_rivlin", {"c10": 0.1786, "c01": 0.0022}, bulk_modulus=20 * 0.3616)         # of the cover
LAWS = {"dielectric": POLYURETHANE, "cover": NEOPRENE}
