"""The `lux` command. Subcommands are named here and imported only when they are called."""

from __future__ import annotations

import importlib
import sys

import click

from luxcore.errors import LuxError, system_sentence

COMMANDS: dict[str, tuple[str, str]] = {
    "run": ("flows.cli:run", "Run the whole flow, or the stages named."),
    "plan": ("flows.cli:plan", "What a run would do, why, how long and how large."),
    "verify": ("flows.cli:verify", "Check every artifact against its manifest."),
    "schedule": ("flows.cli:schedule", "Run on a cron schedule in a worktree of its own."),
    "remix": ("luxcore.cli.remix:command", "Photos to a relightable splat scene."),
    "relight": ("luxcore.cli.relight:command", "One image of a relightable scene."),
    "view": ("luxcore.cli.view:command", "Interactive viewer of a relightable scene."),
    "export": ("luxcore.cli.export:command", "Files that other tools open."),
    "splat": ("luxcore.cli.splat:command", "Rasterize any 3D Gaussian splatting PLY."),
    "decompose": ("luxcore.cli.decompose:command", "One photo and lamp masks to one image a lamp."),
    "render": ("luxcore.cli.render:command", "Render rooms in the public dataset layout."),
    "statistics": ("luxcore.cli.statistics:command", "A page about a rendered dataset."),
    "convert": ("luxcore.cli.convert:command", "Rendered views to the public layout and back."),
    "hdr": ("luxcore.cli.hdr:command", "Merge a photographer's bracket to linear HDR."),
    "evaluate": ("luxcore.cli.evaluate:command", "The tables of scores on a dataset."),
    "tradeoff": ("luxcore.cli.tradeoff:command", "What accuracy costs in time: Pareto curves."),
    "dashboards": ("flows.cli:dashboards", "Start mlflow's and Prefect's pages."),
}
"""Name → ("module:attribute", one line of help), in the order that `lux --help` shows."""


class LazyGroup(click.Group):
    """A group that imports a subcommand's module only to run it, so that help is instant."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, attribute = COMMANDS[cmd_name][0].split(":")
        return getattr(importlib.import_module(module), attribute)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="luxremix", prog_name="lux")
def app() -> None:
    """A switch, a dimmer and a colour wheel for every lamp in a photographed room."""


def main() -> None:
    """Entry point of `lux`: one sentence and an exit code for every failure a user can cause."""
    try:
        code = app.main(standalone_mode=False) or 0
    except LuxError as error:
        code = _complain(str(error), error.exit_code)
    except click.ClickException as error:
        code = _complain(error.format_message(), error.exit_code)
    except (click.Abort, KeyboardInterrupt):
        code = _complain("stopped.", 130)
    except BrokenPipeError:
        code = 1
    except OSError as error:
        sentence = system_sentence(error)
        if sentence is None:
            raise
        code = _complain(sentence, 1)
    sys.exit(code if isinstance(code, int) else 0)


def _complain(sentence: str, code: int) -> int:
    # A file's name may hold a line break.
    print(f"lux: {' '.join(sentence.splitlines())}", file=sys.stderr)
    return code
