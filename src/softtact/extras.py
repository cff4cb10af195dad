"""What the core does without: which extra brings which package, and what to say where one is missing."""

EXTRAS = {"snakemake": "workflow", "jinja2": "workflow", "torch": "learn", "optuna": "learn", "pyvista": "view", "vtk": "view",
          "vtkmodules": "view", "av": "optics", "pypardiso": "mkl", "openpyxl": "excel", "skfem": "skin",
          "mujoco": "robot", "gymnasium": "robot", "pytetwild": "mesh", "warp": "device"}


def missing_extra(error: ImportError) -> str | None:
    """One sentence that says which extra to install for the package that an import did not find; None for any other package."""
    package = (error.name or "").partition(".")[0]
    return how_to_install(package) if package in EXTRAS else None


def how_to_install(package: str) -> str:
    """One sentence that says which extra brings a package of `EXTRAS`."""
    return f"This needs {package}, which is not installed here; run: pip install 'softtact[{EXTRAS[package]}]'."
