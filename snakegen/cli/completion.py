"""`snakegen completion`: what a shell needs to complete commands, options and presets."""

import click

from snakegen.cli import HELP
from snakegen.errors import SnakegenError


@click.command(context_settings=HELP)
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print the completion script of SHELL, to be read by its start-up file.

    \b
    Example:
      snakegen completion bash >> ~/.bashrc
      snakegen completion fish > ~/.config/fish/completions/snakegen.fish
    """
    from click.shell_completion import get_completion_class

    from snakegen.cli import cli

    kind = get_completion_class(shell)
    if kind is None:
        raise SnakegenError(f"click completes no commands for {shell}.")
    click.echo(kind(cli, {}, "snakegen", "_SNAKEGEN_COMPLETE").source())
