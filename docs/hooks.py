"""The reference of the commands, made from their own help while the site is built."""

import inspect
from typing import Any

from mkdocs.structure.files import File, Files


def on_files(files: Files, config: Any) -> Files:
    """Add reference/commands.md."""
    files.append(File.generated(config, "reference/commands.md", content=commands()))
    return files


def commands() -> str:
    """One section a command: what it does, its arguments and options with their defaults."""
    from eaid.cli.main import COMMANDS, load_command

    parts = ["# Commands", "Every option of every command, made from `eaid COMMAND --help`."]
    for name in COMMANDS:
        command = load_command(name)
        parts += [f"## eaid {name}", inspect.cleandoc(command.help or "").replace("\f", "")]
        rows = ["| option | meaning | default |", "|---|---|---|"]
        for option in command.params:
            if getattr(option, "hidden", False) or option.name == "help":
                continue
            names = option.opts if option.param_type_name == "option" else [option.metavar or option.name.upper()]
            spelled = ", ".join(f"`{text}`" for text in names)
            shown = option.default not in (None, False, (), []) and not callable(option.default)
            default = option.default if shown else ""
            words = (getattr(option, "help", None) or "").replace("|", "\\|").replace("<", "&lt;")
            rows.append(f"| {spelled} | {words} | {f'`{default}`' if default != '' else ''} |")
        parts.append("\n".join(rows))
    return "\n\n".join(parts) + "\n"
