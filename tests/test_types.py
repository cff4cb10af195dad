"""Every public function says what it takes and gives."""

import ast
from pathlib import Path

import softtact

PACKAGE = Path(softtact.__file__).parent


def _unstated(function, of_a_class):
    """What of a function has no type: names of arguments, and `return`."""
    static = any(isinstance(one, ast.Name) and one.id == "staticmethod" for one in function.decorator_list)
    given = function.args
    arguments = [*given.posonlyargs, *given.args, *given.kwonlyargs][1 if of_a_class and not static else 0:]
    names = [one.arg for one in [*arguments, given.vararg, given.kwarg] if one is not None and one.annotation is None]
    return names + (["return"] if function.returns is None and function.name != "__init__" else [])


def _public_functions(module):
    for one in module.body:
        if isinstance(one, ast.FunctionDef):
            yield one, False
        if isinstance(one, ast.ClassDef) and not one.name.startswith("_"):
            yield from ((method, True) for method in one.body if isinstance(method, ast.FunctionDef))


def test_public_functions_and_methods_have_types():
    missing = [f"{path.relative_to(PACKAGE)}:{function.lineno} {function.name}: {', '.join(_unstated(function, of_a_class))}"
               for path in sorted(PACKAGE.rglob("*.py"))
               for function, of_a_class in _public_functions(ast.parse(path.read_text(encoding="utf-8")))
               if not function.name.startswith("_") or function.name in ("__init__", "__call__")
               if _unstated(function, of_a_class)]
    assert not missing
