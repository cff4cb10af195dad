"""config/README.md lists every key of every kind of study."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_page_of_keys_is_that_of_the_models():
    spec = importlib.util.spec_from_file_location("write_config_keys", ROOT / "scripts/write_config_keys.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    assert (ROOT / "config/README.md").read_text(encoding="utf-8") == script.page(), "run python scripts/write_config_keys.py"
