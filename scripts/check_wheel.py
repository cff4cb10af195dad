"""The size of what `pip install softtact` brings, package by package; an error where it is more than 500 MB.

    python3.11 -m venv /tmp/fresh && /tmp/fresh/bin/pip install dist/softtact-*.whl
    /tmp/fresh/bin/python scripts/check_wheel.py

Run it with the interpreter of an environment that holds the wheel and nothing else. Counted is what the wheels contain; the
bytecode that pip and Python make of it has a column of its own.
"""

import sys
from importlib.metadata import Distribution, distributions

MOST_MB = 500
SHOWN_MB = 5             # smaller packages are added up in one line
WITH_PYTHON = ("pip", "setuptools", "wheel")     # in each new environment


def sizes(distribution: Distribution) -> tuple[float, float]:
    """MB of a package's files, and of its bytecode."""
    files, bytecode = 0, 0
    for file in distribution.files or ():
        path = distribution.locate_file(file)
        if path.is_file():     # type: ignore[attr-defined]
            size = path.stat().st_size     # type: ignore[attr-defined]
            bytecode, files = (bytecode + size, files) if file.suffix == ".pyc" else (bytecode, files + size)
    return files / 1e6, bytecode / 1e6


def table(packages: dict[str, tuple[float, float]]) -> list[str]:
    """Lines of a table: the largest packages first, the small ones added up, and the sum."""
    rows = sorted(packages.items(), key=lambda row: -row[1][0])
    large = [row for row in rows if row[1][0] >= SHOWN_MB]
    small = [size for _, size in rows[len(large):]]
    rows = [*large, (f"{len(small)} smaller packages", _sum(small)), ("all", _sum(packages.values()))]
    return [f"{'package':24} {'MB':>6} {'bytecode':>9}", *(f"{name:24} {files:6.0f} {made:9.0f}" for name, (files, made) in rows)]


def _sum(pairs):
    pairs = list(pairs)
    return sum(files for files, _ in pairs), sum(bytecode for _, bytecode in pairs)


def main() -> int:
    """Print the table; 1 where the packages are too large."""
    packages = {one.name: sizes(one) for one in distributions() if one.name not in WITH_PYTHON}
    print("\n".join(table(packages)))
    total, _ = _sum(packages.values())
    if "softtact" not in packages:
        print("softtact is not installed here; run this with the interpreter of an environment that holds it.", file=sys.stderr)
    elif total > MOST_MB:
        print(f"The core takes {total:.0f} MB, more than {MOST_MB}; move what no press needs into an extra of pyproject.toml.",
              file=sys.stderr)
    return int("softtact" not in packages or total > MOST_MB)


if __name__ == "__main__":
    sys.exit(main())
