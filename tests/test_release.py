"""A release states one version in every file, and its recipe what pyproject.toml states."""

import re
import tomllib
from pathlib import Path

import pytest
import release
import yaml

import softtact

ROOT = Path(__file__).resolve().parents[1]


def test_each_file_that_states_the_version_states_that_of_the_package():
    citation, recipe = (yaml.safe_load((ROOT / name).read_text()) for name in ("CITATION.cff", "recipe/recipe.yaml"))
    assert citation["version"] == recipe["context"]["version"] == softtact.__version__


def test_the_recipe_states_each_name_that_its_texts_use():
    text = (ROOT / "recipe/recipe.yaml").read_text()
    used = set(re.findall(r"\$\{\{ (\w+) \}\}", text))
    assert "version" in used and used <= set(yaml.safe_load(text)["context"])


def test_the_recipe_needs_what_the_core_needs():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    requirements = yaml.safe_load((ROOT / "recipe/recipe.yaml").read_text())["requirements"]
    spaced = [re.sub(r"(?=[<>=])", " ", one, count=1) for one in project["project"]["dependencies"]]
    assert requirements["run"] == [f"python {project['project']['requires-python']}", *spaced]
    backend = [re.sub(r"(?=[<>=])", " ", one, count=1) for one in project["build-system"]["requires"]]
    assert requirements["host"] == [requirements["run"][0], "pip", *backend]


def test_a_release_writes_its_version_and_day_into_every_file():
    texts = {path.name: text for path, text in release.prepared_files("98.7.6", "2031-02-03").items()}
    assert '__version__ = "98.7.6"\n' in texts["__init__.py"]
    assert "\nversion: 98.7.6\ndate-released: 2031-02-03\n" in texts["CITATION.cff"]
    assert yaml.safe_load(texts["recipe.yaml"])["context"]["version"] == "98.7.6"
    assert "## Unreleased\n\n## 98.7.6 (2031-02-03)\n" in texts["CHANGELOG.md"]


@pytest.mark.parametrize(("version", "said"), [("1.0", "three numbers"), ("0.0.9", "it comes before"), ("v9.0.0", "three numbers")])
def test_another_form_of_version_or_an_earlier_one_is_refused(version, said):
    with pytest.raises(ValueError, match=f"VERSION={version}: .*{said}"):
        release.checked_version(version, "0.1.0")


@pytest.mark.parametrize("changelog", ["# Changelog\n\n## Unreleased\n\n## 0.1.0 (2026-01-01)\n- First.\n", "# Changelog\n",
                                       "# Changelog\n\n## Unreleased\n- New.\n\n## 0.2.0 (2026-01-01)\n"])
def test_a_release_without_changes_or_a_second_of_one_version_is_refused(changelog):
    with pytest.raises(ValueError, match=r"CHANGELOG\.md"):
        release.changelog_with(changelog, "0.2.0", "2026-02-01")


def test_the_paper_cites_what_its_bibliography_holds_and_each_entry_says_where_it_is_found():
    cited = set(re.findall(r"@([a-z]+)", (ROOT / "paper/paper.md").read_text()))
    entries = dict(re.findall(r"^@[a-z]+\{([a-z]+),\n(.*?)^\}", (ROOT / "paper/paper.bib").read_text(), re.MULTILINE | re.DOTALL))
    assert cited == set(entries)
    assert all(re.search(r"^  doi +=|howpublished", entry, re.MULTILINE) for entry in entries.values())
    assert all(re.search(rf"^  {field} +=", entry, re.MULTILINE) for entry in entries.values()
               for field in ("title", "author", "year"))


def test_the_paper_has_the_head_and_the_sections_of_its_journal():
    _, head, text = (ROOT / "paper/paper.md").read_text().split("---\n", 2)
    stated, citation = yaml.safe_load(head), yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= set(stated) and len(stated["tags"]) >= 3
    assert [one["name"] for one in stated["authors"]] == [one["name"] for one in citation["authors"]]
    assert {one["affiliation"] for one in stated["authors"]} == {one["index"] for one in stated["affiliations"]}
    assert (ROOT / "paper" / stated["bibliography"]).is_file()
    sections = re.findall(r"^# (.*)$", text, re.MULTILINE)
    assert {"Summary", "Statement of need", "State of the field", "Software design"} <= set(sections)
    assert sections[-1] == "References"
