"""Prepare a release: version, changelog, citation and recipe, wheel and sdist, and their tests in a new environment.

    make release VERSION=0.2.0

Nothing is pushed or uploaded. The changed files are left for review, the packages are in dist/, and the last lines say what to
type.
"""

import argparse
import datetime
import re
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
UPLOAD = """
Prepared softtact {version} in dist/; nothing was pushed. Review `git diff`, then type:

    git commit -am "Release {version}" && git tag v{version} && git push && git push origin v{version}
    python -m twine upload dist/softtact-{version}*
    sha256sum dist/softtact-{version}.tar.gz     # for recipe/recipe.yaml, before it goes to conda-forge
"""
_UNRELEASED = "## Unreleased\n"


def checked_version(version: str, before: str) -> str:
    """The version, which is three numbers and not before the last one. Raises ValueError."""
    if not re.fullmatch(r"\d+\.\d+\.\d+", version):
        raise ValueError(f"VERSION={version}: write three numbers such as 0.2.0.")
    if _numbers(version) < _numbers(before):
        raise ValueError(f"VERSION={version}: it comes before {before}, which src/softtact/__init__.py states; take a later one.")
    return version


def changelog_with(text: str, version: str, day: str) -> str:
    """The changelog whose unreleased changes are those of the version. Raises ValueError where there are none."""
    changes = text.partition(_UNRELEASED)[2].partition("\n## ")[0]
    if f"\n## {version} " in text or not changes.strip():
        raise ValueError(f"CHANGELOG.md: nothing stands below '{_UNRELEASED.strip()}', or {version} is there; write what changed.")
    return text.replace(_UNRELEASED, f"{_UNRELEASED}\n## {version} ({day})\n", 1)


def with_field(text: str, pattern: str, value: str, *, of: str) -> str:
    """A file with the value in place of the one group of the pattern. Raises ValueError where the pattern is not there once."""
    found = re.findall(pattern, text, re.MULTILINE)
    if len(found) != 1:
        raise ValueError(f"{of}: {pattern} is there {len(found)} times, and once is needed; correct the file.")
    return re.sub(pattern, lambda match: match[0].replace(match[1], value), text, flags=re.MULTILINE)


def prepared_files(version: str, day: str) -> dict[Path, str]:
    """The new text of each file that states the version."""
    module, citation, recipe, changelog = (ROOT / name for name in ("src/softtact/__init__.py", "CITATION.cff",
                                                                    "recipe/recipe.yaml", "CHANGELOG.md"))
    stated = r'^__version__ = "(.*)"$'
    before = re.findall(stated, module.read_text(), re.MULTILINE)[0]
    checked_version(version, before)
    dated = with_field(citation.read_text(), r"^date-released: (.*)$", day, of="CITATION.cff")
    return {module: with_field(module.read_text(), stated, version, of=str(module)),
            citation: with_field(dated, r"^version: (.*)$", version, of="CITATION.cff"),
            recipe: with_field(recipe.read_text(), r'^  version: "(.*)"$', version, of="recipe/recipe.yaml"),
            changelog: changelog_with(changelog.read_text(), version, day)}


def build(folder: Path, version: str) -> list[Path]:
    """Wheel and sdist of the version in dist/, checked by twine; the wheel is built from the sdist."""
    tools = _environment(folder / "tools")
    _run(tools, "-m", "pip", "install", "--quiet", "build", "twine")
    for old in (ROOT / "dist").glob("*"):
        old.unlink()
    _run(tools, "-m", "build", "--outdir", ROOT / "dist", ROOT)
    packages = sorted((ROOT / "dist").glob(f"softtact-{version}*"))
    if len(packages) != 2:
        raise ValueError(f"dist/: {len(packages)} packages of {version}, and a wheel and an sdist were expected.")
    _run(tools, "-m", "twine", "check", "--strict", *packages)
    return packages


def try_wheel(folder: Path, wheel: Path) -> None:
    """Install the wheel alone, measure it, press as the README does, and run the marked tests; outside of the repository."""
    python = _environment(folder / "fresh")
    _run(python, "-m", "pip", "install", "--quiet", "--no-compile", "-c", ROOT / "constraints.txt", wheel)
    _run(python, ROOT / "scripts/check_wheel.py")
    _run(python, "-c", "import trimesh; trimesh.creation.box((4, 4, 3)).export('part.stl')", cwd=folder)
    _run(python, "-m", "softtact", *"press part.stl --unit mm --force 5 --force 10 --out press.nc".split(), cwd=folder)
    _run(python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", "pytest")
    _run(python, "-m", "pytest", "-m", "wheel", "-p", "no:cacheprovider", ROOT / "tests/test_wheel.py", cwd=folder)


def main() -> int:
    """Prepare the release; 1 with a sentence where a file does not allow it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("version", help="three numbers, such as 0.2.0")
    parser.add_argument("--date", default=datetime.date.today().isoformat(), help="day of the release (default: today)")
    options = parser.parse_args()
    try:
        files = prepared_files(options.version, options.date)
        for path, text in files.items():
            path.write_text(text, encoding="utf-8")
        with tempfile.TemporaryDirectory() as name:
            packages = build(Path(name), options.version)
            try_wheel(Path(name), next(package for package in packages if package.suffix == ".whl"))
    except ValueError as error:
        print(f"release: {error}", file=sys.stderr)
        return 1
    except subprocess.CalledProcessError as error:
        print(f"release: {' '.join(map(str, error.cmd))} failed; what it said stands above.", file=sys.stderr)
        return 1
    print(UPLOAD.format(version=options.version))
    return 0


def _numbers(version):
    return tuple(map(int, version.split(".")))


def _environment(folder):
    """The interpreter of a new environment."""
    venv.create(folder, with_pip=True)
    return folder / "bin/python"


def _run(python, *arguments, cwd=ROOT):
    print("$", "python", *arguments, flush=True)
    subprocess.run([python, *arguments], check=True, cwd=cwd)


if __name__ == "__main__":
    sys.exit(main())
