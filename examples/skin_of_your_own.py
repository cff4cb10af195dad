"""Compare two thicknesses of a skin under a light touch, beside and on a taxel.

    python examples/skin_of_your_own.py --elastomer SomaFoama --thickness 1 2 3
"""

import argparse
from collections.abc import Sequence

import pandas as pd

from softtact.skin.analysis import Skin
from softtact.skin.elastomers import find_elastomer, read_elastomers
from softtact.skin.layout import module_layout
from softtact.skin.loads import disc


def main(arguments: Sequence[str] | None = None) -> pd.DataFrame:
    """Print and return a row for each thickness: rise of taxel 7 in fF on it and 2.5 mm beside it, at 10 kPa."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--elastomer", default="SomaFoama", help="a name of softtact/skin/data/elastomers.yaml")
    parser.add_argument("--thickness", type=float, nargs="+", default=[1.0, 2.0, 3.0], metavar="MM")
    options = parser.parse_args(arguments)
    elastomer = find_elastomer(options.elastomer, read_elastomers(), where="--elastomer")
    rows = []
    for thickness in options.thickness:
        skin = Skin(module_layout(), thickness_mm=thickness, poisson=elastomer.poisson, permittivity=elastomer.permittivity_fe)
        x, y = skin.layout.centres_mm[6]
        young = elastomer.young_mpa(0.01)
        # To first order in the load, one solve for a taxel gives its response to a touch at any place.
        on, beside = (skin.first_order_ff(disc((x + shift, y), diameter_mm=4.0, pressure_mpa=0.01), young_mpa=young)[6]
                      for shift in (0.0, 2.5))
        rows.append({"thickness_mm": thickness, "on_ff": on, "beside_ff": beside})
        print(f"{thickness:g} mm: {on:.2f} fF on the taxel, {beside:.2f} fF beside it")
    return pd.DataFrame(rows)


if __name__ == "__main__":
    main()
