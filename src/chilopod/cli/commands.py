"""Commands and groups of commands: errors are named as options were typed, and help lists what is registered."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

from chilopod.errors import ChilopodError, ParameterError

_TYPED_AS = {
    **{"joint_angles": "initial_joints", "spring": "k1", "twin": "engine", "body.modules": "modules"},
    **{"quantities": "show", "tolerances": "uncertain", "target": "targets"},
}
"""Options that are called otherwise than the argument of the function that they are for."""

_IN_WORDS = {"Input should be": "must be", "greater than or equal to": "at least", "less than or equal to": "at most"}
"""Words for those of pydantic, which checks the numbers of options."""


class _Group(TyperGroup):
    """A group that knows the commands of the groups in it: of ``export`` it says ``robot export``."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        typed = args[0]
        try:
            return super().resolve_command(ctx, args)
        except Exception as error:
            groups = [name for name, own in self.commands.items() if typed in getattr(own, "commands", ())]
            if groups and hasattr(error, "message"):
                error.message += f" Did you mean {' or '.join(f'{name} {typed}' for name in groups)}?"
            raise


class _Command(TyperCommand):
    """A command whose mistakes are named as they were typed, ``--duration`` and the text behind it, and whose help
    lists the choices that are registered and ends with an example, the last paragraph of its docstring."""

    def __init__(self, *args: Any, **settings: Any) -> None:
        super().__init__(*args, **settings)
        text, _, example = (self.help or "").partition("\n\nExample: ")
        if example:
            self.help, self.epilog = text, f"\b\nExample:\n  {' '.join(example.split())}"

    def format_help(self, ctx: Any, formatter: Any) -> None:
        for option in self.params:
            if isinstance(option, TyperOption) and option.name == "strategy" and option.metavar is None:
                known = option.shell_complete(ctx, "")
                option.metavar = "|".join(each.value for each in known)
                option.help = " ".join([option.help or "", *(f"{each.value}: {each.help}." for each in known)])
        super().format_help(ctx, formatter)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        for option in self.params:
            single = isinstance(option, TyperOption) and not (option.is_flag or option.multiple)
            names = option.opts if single else []
            if sum(each.partition("=")[0] in names for each in args) > 1:  # all but the last would be lost
                raise ParameterError("must be given once", field=max(names, key=len))
        try:
            return super().parse_args(ctx, args)
        except Exception as error:
            if hasattr(error, "ctx"):
                error.ctx = error.ctx or ctx
            cause = error.__cause__
            if not (cause and hasattr(error, "param") and hasattr(cause, "errors")):
                raise
            wrong = cause.errors()[0]
            problem = wrong["msg"].partition(",")[0]
            for theirs, ours in _IN_WORDS.items():
                problem = problem.replace(theirs, ours)
            raise ParameterError(problem, field=max(error.param.opts, key=len), value=wrong["input"]) from None

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except ChilopodError as error:
            _as_typed(error, ctx)
            raise


def _as_typed(error: ChilopodError, ctx: Any) -> None:
    field, _, part = (error.field or "").partition(" ")
    name = field if error.source else _TYPED_AS.get(field, field)  # a file has names of its own
    for option in ctx.command.params:
        if option.name not in (name, field) or option.param_type_name != "option" or option.is_flag:
            continue
        error.field = f"{max(option.opts, key=len)} {part}".strip()
        typed = ctx.params[option.name]
        if not part and ctx.get_parameter_source(option.name).name == "COMMANDLINE":
            several = isinstance(typed, tuple | list)
            error.value = typed if not several else error.value if error.value in typed else " ".join(typed)
        if isinstance(error.value, Path):
            error.value = str(error.value)


class _App(typer.Typer):
    def command(self, name: str | None = None, **settings: Any) -> Any:
        return super().command(name, cls=_Command, **settings)


def new_app(help_text: str, *, completion: bool = False) -> typer.Typer:
    """An empty group of commands with the settings all groups share; only the outermost can complete commands."""
    # Help without rich: importing it costs a third of what --help may take. Tracebacks are the business of `main`.
    app = _App(
        help=help_text,
        cls=_Group,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        add_completion=completion,
        no_args_is_help=False,
    )

    @app.callback(invoke_without_command=True)
    def group(ctx: typer.Context) -> None:
        if ctx.invoked_subcommand is None:
            typer.echo(ctx.get_help())

    return app
