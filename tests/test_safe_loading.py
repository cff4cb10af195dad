"""No file can run code: nothing in the source unpickles, evaluates, or loads what may hold objects."""

import ast
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[1] / "src"
FORBIDDEN_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}
FORBIDDEN_CALLS = {"eval", "exec", "yaml.load", "yaml.full_load", "yaml.unsafe_load", "yaml.load_all", "pandas.read_pickle",
                   "pd.read_pickle", "os.system", "os.popen"}
NEEDED = {"torch.load": ("weights_only", True), "np.load": ("allow_pickle", False), "numpy.load": ("allow_pickle", False)}


def faults(text):
    """What a module does that a file could use to run code."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
            yield from (f"imports {name}" for name in names if name.split(".")[0] in FORBIDDEN_MODULES)
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            if called in FORBIDDEN_CALLS:
                yield f"calls {called}"
            if called in NEEDED:
                name, value = NEEDED[called]
                given = [word.value.value for word in node.keywords if word.arg == name and isinstance(word.value, ast.Constant)]
                if given != [value]:
                    yield f"{called} without {name}={value}"
            if any(word.arg == "shell" and getattr(word.value, "value", None) is True for word in node.keywords):
                yield f"{called} in a shell"


def test_the_search_finds_what_it_is_for():
    for text in ("import pickle", "from joblib import load", "torch.load(p)", "torch.load(p, weights_only=False)", "np.load(p)",
                 "yaml.load(t, Loader=L)", "eval(t)", "subprocess.run(t, shell=True)"):
        assert list(faults(text)), text


def test_the_source_loads_only_data():
    found = {str(path.relative_to(SOURCE)): told for path in SOURCE.rglob("*.py")
             if (told := list(faults(path.read_text(encoding="utf-8"))))}
    assert found == {}
