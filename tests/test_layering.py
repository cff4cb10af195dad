"""The packages' order: imports go downwards only, no circle arises, and no file is too long to be read at once."""

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src/softtact"
MOST_LINES = 500
# From below: a package imports from those of the lines before its own, and from itself; those of one line know nothing of each
# other.
ORDER = (
    ("errors",),
    ("unknown_names", "progress", "devices", "processes", "words"),
    ("checksums", "inputs", "kernel_files"),
    ("outputs", "compiled"),
    ("files", "drawing", "exits"),
    ("workbooks",),
    ("tables",),
    ("linalg", "geometry", "materials"),
    ("sensors", "contact", "fem"),
    ("models.quarter_symmetry", "models.newton"),
    ("models.elastic", "models.hyperelastic", "models.solid"),
    ("models.foundation", "models.ftir"),
    ("models.meshes", "decks"),
    ("imaging", "published"),
    ("readout",),
    ("skin", "probe"),
    ("press",),
    ("robot", "learning", "calibration"),
    ("evaluation",),
    ("reporting",),
    ("studies",),
    ("play",),
    ("commands",),
    ("cli",),
    ("__main__",),
)
LEVEL = {package: level for level, packages in enumerate(ORDER) for package in packages}


def name_of(path):
    """A file's module, without `softtact`; that of the package itself is the empty name."""
    parts = path.relative_to(SOURCE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in sorted(SOURCE.rglob("*.py"))}


def imports_of(path):
    """Modules of softtact that a file imports, in its functions too, and the names that it takes from softtact itself.

    What stands under `if TYPE_CHECKING` is imported by no program, and left out.
    """
    found, names = set(), set()
    for node in _nodes(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name.split(".")[0] == "softtact"}
        elif isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "softtact":
            inner = node.module.removeprefix("softtact").lstrip(".")
            for alias in node.names:
                below = f"{inner}.{alias.name}".lstrip(".")
                if below in MODULES:
                    found.add(f"softtact.{below}")
                elif inner:
                    found.add(node.module)
                else:
                    names.add(alias.name)
        assert not (isinstance(node, ast.ImportFrom) and node.level), f"{path}: imports are written with their whole names"
    return {name.removeprefix("softtact").lstrip(".") for name in found if name != "softtact"}, names


def _nodes(tree):
    """The tree's nodes without those under `if TYPE_CHECKING`."""
    yield tree
    for child in ast.iter_child_nodes(tree):
        if not (isinstance(child, ast.If) and ast.unparse(child.test).endswith("TYPE_CHECKING")):
            yield from _nodes(child)


def package_of(module):
    """The name in ORDER that a module belongs to."""
    parts = module.split(".")
    return ".".join(parts[:2]) if parts[0] == "models" and len(parts) > 1 else parts[0]


@pytest.fixture(scope="module")
def graph():
    """What each module imports, but for the package itself: it is the public face, and loads what it shows when asked for it."""
    return {module: imports_of(path)[0] for module, path in MODULES.items() if module}


def test_every_package_has_its_place_in_the_order(graph):
    packages = {package_of(module) for module in graph if module != "models"}
    assert packages <= set(LEVEL), f"give a line of ORDER to {sorted(packages - set(LEVEL))}"


def test_no_import_goes_upwards(graph):
    upwards = [f"{module} imports {other}" for module, others in graph.items() for other in others
               if package_of(module) != package_of(other) and LEVEL[package_of(module)] <= LEVEL[package_of(other)]]
    assert not upwards


def test_no_modules_import_each_other_in_a_circle(graph):
    try:
        tuple(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_from_the_package_itself_only_its_version_is_taken():
    taken = {module: imports_of(path)[1] - {"__version__"} for module, path in MODULES.items()}
    assert not {module: names for module, names in taken.items() if names}


def test_the_imports_that_are_checked_are_those_that_python_makes(graph):
    """One of each kind: of names, of a module, within a function."""
    assert "fem.kernels" in graph["fem.solid_block"]
    assert "linalg.multifrontal" in graph["linalg.multifrontal_solver"]
    assert "studies.__main__" in graph["commands.stage"]


def test_no_file_is_longer_than_can_be_read_at_once():
    lengths = {module: len(path.read_text(encoding="utf-8").splitlines()) for module, path in MODULES.items()}
    assert not {module: length for module, length in lengths.items() if length > MOST_LINES}
