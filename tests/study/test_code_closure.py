"""Which files a stage's closure holds decides what an edit reruns."""

import textwrap
from pathlib import Path

import pytest

from softtact.studies.code_closure import code_closure
from softtact.studies.jobs import stage_source, stages_of
from softtact.studies.registry import KINDS

SOURCE = Path(__file__).resolve().parents[2] / "src"
# An edit of these reruns nothing.
UNRELATED = {"cli.py", "studies/hybrid/config.py", "studies/code_closure.py", "studies/__main__.py", "studies/jobs.py",
             "studies/registry.py"}
STAGES = [stage for kind in KINDS for stage in stages_of(kind, source=SOURCE)]


@pytest.fixture
def package(tmp_path):
    """Write {path: text} below a source folder; the closure of a module comes back as relative paths."""

    def closure_of(module, files):
        for path, text in files.items():
            (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / path).write_text(textwrap.dedent(text))
        return [str(Path(path).relative_to(tmp_path)) for path in code_closure(module, source=tmp_path)]

    return closure_of


def test_imports_are_followed_to_the_end(package):
    files = {"p/a.py": "from p.b import f", "p/b.py": "import p.c", "p/c.py": "import numpy", "p/d.py": ""}
    assert package("p.a", files) == ["p/a.py", "p/b.py", "p/c.py"]


def test_a_late_import_counts(package):
    files = {"p/a.py": "def f():\n    from p import b", "p/b.py": ""}
    assert package("p.a", files) == ["p/a.py", "p/b.py"]


def test_relative_imports_are_resolved(package):
    files = {"p/q/a.py": "from ..b import x\nfrom . import c", "p/b.py": "", "p/q/c.py": ""}
    assert package("p.q.a", files) == ["p/b.py", "p/q/a.py", "p/q/c.py"]


def test_a_packages_own_file_counts_only_where_a_name_comes_from_it(package):
    files = {"p/__init__.py": "x = 1", "p/a.py": "from p import b", "p/b.py": "", "p/c.py": "from p import x"}
    assert package("p.a", files) == ["p/a.py", "p/b.py"]
    assert package("p.c", files) == ["p/__init__.py", "p/c.py"]


def test_what_a_package_imports_late_for_its_users_is_not_followed(package):
    files = {"p/__init__.py": "def f():\n    from p.heavy import g", "p/heavy.py": "", "p/a.py": "import p"}
    assert package("p.a", files) == ["p/__init__.py", "p/a.py"]


def test_what_is_imported_for_types_only_does_not_count(package):
    files = {"p/a.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from p.b import B\nelse:\n    from p import c",
             "p/b.py": "", "p/c.py": ""}
    assert package("p.a", files) == ["p/a.py", "p/c.py"]


def test_circular_imports_end(package):
    assert package("p.a", {"p/a.py": "import p.b", "p/b.py": "import p.a"}) == ["p/a.py", "p/b.py"]


def test_no_stage_depends_on_the_command_line_or_the_runner():
    for stage in STAGES:
        module = stage_source(stage, source=SOURCE)
        names = {str(Path(path).relative_to(SOURCE / "softtact")) for path in code_closure(module, source=SOURCE)}
        assert f"{module.partition(':')[0].removeprefix('softtact.').replace('.', '/')}.py" in names
        assert not names & UNRELATED, stage


def test_the_fits_do_not_depend_on_learning_or_mechanics():
    closure = code_closure("softtact.studies.hybrid.stages.fit_material", source=SOURCE)
    folders = {Path(path).relative_to(SOURCE / "softtact").parts[0] for path in closure}
    assert folders <= {"__init__.py", "checksums.py", "compiled.py", "errors.py", "files.py", "inputs.py", "kernel_files.py",
                       "outputs.py", "progress.py", "tables.py", "unknown_names.py", "workbooks.py", "materials", "studies"}
