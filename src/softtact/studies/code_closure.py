"""Which source files a module runs: its static imports inside `src/`, followed to the end.

Snakemake does not notice an edit inside an imported package. So every rule names the closure of its stage as an input,
and an edit reruns just the stages that import the edited file.
"""

import ast
from functools import cache
from pathlib import Path


def code_closure(module: str, *, source: str | Path = "src") -> list[str]:
    """Sorted paths of `module`'s file and of everything below `source` that it imports, directly or not."""
    source = Path(source)
    found, waiting = set(), [_file(module, source)]
    while waiting:
        path = waiting.pop()
        if path is None or path in found:
            continue
        found.add(path)
        waiting += [file for file in _imported_files(path, source)]
    return sorted(str(path) for path in found)


def _imported_files(path, source):
    """Files below `source` that the imports of `path` reach."""
    for node in _imports(path.read_text(encoding="utf-8"), module_level=path.name == "__init__.py"):
        if isinstance(node, ast.Import):
            yield from (_file(alias.name, source) for alias in node.names)
        else:
            base = _absolute(node, path, source)
            yield from (_file_of_name(base, alias.name, source) for alias in node.names)


@cache
def _imports(text, *, module_level):
    """The import statements of a source text. Parsed once, since the closures of a workflow's rules have most files in common.

    A package's own functions import late and for its users only; its module level is what everyone runs. What stands under
    `if TYPE_CHECKING:` is never run.
    """
    tree = ast.parse(text)
    nodes = tree.body if module_level else list(ast.walk(tree))
    unrun = {id(below) for node in nodes if _for_types_only(node) for child in node.body for below in ast.walk(child)}
    return [node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom) and id(node) not in unrun]


def _for_types_only(node):
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def _file_of_name(package, name, source):
    """The file that `from package import name` runs: the submodule `name`, or else the package's own file.

    A package whose submodule is imported has its `__init__.py` left out: those files are empty here, and would tie
    every stage to every package.
    """
    return _file(f"{package}.{name}", source) or _file(package, source)


def _file(module, source):
    """The file of a dotted module name, or None outside `source`."""
    stem = source.joinpath(*module.split("."))
    candidates = (stem.with_name(stem.name + ".py"), stem / "__init__.py")
    return next((path for path in candidates if path.is_file()), None)


def _absolute(node, path, source):
    """Dotted name of the package that a from-import names; leading dots count from the importing file's package."""
    if not node.level:
        return node.module
    package = path.relative_to(source).parts[:-1]
    base = package[: len(package) - node.level + 1]
    return ".".join([*base, *([node.module] if node.module else [])])
