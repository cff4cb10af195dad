"""`softtact completion` for completion in a shell, `softtact config-schema` for completion of YAML files in an editor."""

import argparse
import json
from pathlib import Path
from typing import Any

from softtact.commands.common import add_command
from softtact.outputs import check_outputs

SHELLS = ("bash", "zsh", "fish")
KINDS = ("study", "sensor", "material")
SHELL_EXAMPLES = """
  softtact completion bash >> ~/.bashrc
  softtact completion zsh  >> ~/.zshrc          # below the line that calls compinit
  softtact completion fish > ~/.config/fish/completions/softtact.fish
"""
SCHEMA_EXAMPLES = """
  softtact config-schema study > study.schema.json
  softtact config-schema sensor --out sensor.schema.json
An editor with YAML support checks a file whose first line is:
  # yaml-language-server: $schema=study.schema.json
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add both commands to the parser."""
    schema = add_command(commands, "config-schema", _schema, "Print the JSON schema of a study's, a sensor's or a material's YAML.",
                         SCHEMA_EXAMPLES, json=False)
    schema.add_argument("kind", choices=KINDS, help="which file")
    schema.add_argument("--out", type=Path, metavar="FILE.json", help="file to write; without it the schema is printed")
    shell = add_command(commands, "completion", _completion, "Print a shell's completion of this command.", SHELL_EXAMPLES,
                        json=False)
    shell.add_argument("shell", choices=SHELLS, help="the shell to write completion for")


def _completion(options):
    import argcomplete

    print(argcomplete.shellcode(["softtact"], shell=options.shell))


def _schema(options):
    from softtact.files import write_json

    check_outputs(options.out)
    if options.out:
        write_json(options.out, schema_of(options.kind))
    else:
        print(json.dumps(schema_of(options.kind), indent=2, sort_keys=True))


def schema_of(kind: str) -> dict[str, Any]:
    """The JSON schema of a kind of file, generated from the types that read it."""
    from softtact.materials.config import MaterialConfig
    from softtact.sensors.specification import sensor_schema
    from softtact.studies.hybrid.keys import Values

    schema = {"study": Values.model_json_schema, "sensor": sensor_schema, "material": MaterialConfig.model_json_schema}[kind]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | schema()
