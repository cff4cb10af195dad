"""`softtact completion`: what makes a shell complete softtact's commands, options and files."""

import argparse

from softtact.commands.common import add_command

SHELLS = ("bash", "zsh", "fish")
EXAMPLES = """
  softtact completion bash >> ~/.bashrc
  softtact completion zsh  >> ~/.zshrc          # below the line that calls compinit
  softtact completion fish > ~/.config/fish/completions/softtact.fish
"""


def add(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "completion", _completion, "Print a shell's completion of this command.", EXAMPLES, json=False)
    command.add_argument("shell", choices=SHELLS, help="the shell to write completion for")


def _completion(options):
    import argcomplete

    print(argcomplete.shellcode(["softtact"], shell=options.shell))
