"""The source files that a stage runs: the transitive closure of its static imports inside `src/`.

Snakemake does not notice an edit inside an imported package. So the digest of its stage's closure is a parameter of every rule,
and an edit reruns just the stages that import the edited file. A study that runs without Snakemake stores the same digest.
"""

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from hashlib import sha256
from pathlib import Path

Import = ast.Import | ast.ImportFrom
_FUNCTION = ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda


def code_closure(stage: str, *, source: str | Path = "src") -> list[str]:
    """Sorted paths of a stage's file and of all files of its package below `source` that it imports, directly or indirectly.

    stage: `module`, or `module:function`, for which the imports of the function count, those of the module's functions that it
        calls, and those at module level
    """
    module, _, function = stage.partition(":")
    source = Path(source)
    first = _file(module, source)
    if first is None:
        return []
    found, waiting = {str(first)}, list(_reached(str(first), source, function))
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _reached(path, source)
    return sorted(found)


def code_digest(stage: str, *, source: str | Path = "src") -> str:
    """Hash of the names and contents of a stage's closure, the same for an installed package and a project's `src/`."""
    source = Path(source)
    found = sha256()
    for path in code_closure(stage, source=source):
        found.update(f"{Path(path).relative_to(source).as_posix()} {_content_digest(path)}\n".encode())
    return found.hexdigest()


@cache
def _content_digest(path: str) -> str:
    return sha256(Path(path).read_bytes()).hexdigest()


@cache
def _reached(file: str, source: Path, function: str = "") -> list[str]:
    """Files of its package that a file imports. Cached, because the closures of a workflow's rules share most files."""
    path = Path(file)
    text, package, reached = path.read_text(encoding="utf-8"), path.relative_to(source).parts[0], []
    for node in _imports_of_function(text, function) if function else _imports_of_file(text, path):
        if isinstance(node, ast.Import):
            files = [_file(alias.name, source) for alias in node.names if alias.name.split(".")[0] == package]
        else:
            base = _absolute(node, path, source)
            files = [_file_of_name(base, alias.name, source) for alias in node.names] if base.split(".")[0] == package else []
        reached += [str(found) for found in files if found]
    return reached


def _imports_of_file(text: str, path: Path) -> list[Import]:
    """The import statements that an import of the file may run.

    In a package's `__init__.py` only those at module level, since its functions import lazily for users.
    """
    return _imports(_run(ast.parse(text).body, into_functions=path.name != "__init__.py"))


def _imports_of_function(text: str, name: str) -> list[Import]:
    """The import statements at module level, in a function of the module, and in its functions and classes that this uses."""
    tree = ast.parse(text)
    defined = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    used: dict[str, ast.AST] = {}
    waiting = [name]
    while waiting:
        node = defined.get(waiting.pop())
        if node is not None and node.name not in used:
            used[node.name] = node
            waiting += [below.id for below in ast.walk(node) if isinstance(below, ast.Name)]
    return _imports([*_run(tree.body, into_functions=False), *_run(used.values())])


def _imports(nodes: Iterable[ast.AST]) -> list[Import]:
    return [node for node in nodes if isinstance(node, Import)]


def _run(nodes: Iterable[ast.AST], *, into_functions: bool = True) -> Iterator[ast.AST]:
    """The nodes and all below them, without those under `if TYPE_CHECKING:`, which never run."""
    for node in nodes:
        yield node
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            yield from _run(node.orelse, into_functions=into_functions)
        elif into_functions or not isinstance(node, _FUNCTION):
            yield from _run(ast.iter_child_nodes(node), into_functions=into_functions)


def _file_of_name(package: str, name: str, source: Path) -> Path | None:
    """The file that `from package import name` runs: the submodule `name`, or else the package's file.

    The `__init__.py` of a package whose submodule is imported is left out: these files are empty here, and would make every
    stage depend on every package.
    """
    return _file(f"{package}.{name}", source) or _file(package, source)


def _file(module: str, source: Path) -> Path | None:
    """The file of a dotted module name, or None outside `source`."""
    stem = source.joinpath(*module.split("."))
    candidates = (stem.with_name(stem.name + ".py"), stem / "__init__.py")
    return next((path for path in candidates if path.is_file()), None)


def _absolute(node: ast.ImportFrom, path: Path, source: Path) -> str:
    """Dotted name of the package that a from-import names; leading dots count from the importing file's package."""
    if not node.level:
        return node.module or ""
    package = path.relative_to(source).parts[:-1]
    base = package[: len(package) - node.level + 1]
    return ".".join([*base, *([node.module] if node.module else [])])
