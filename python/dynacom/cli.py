# SPDX-License-Identifier: BSD-2-Clause
"""The command ``dynacom``.

Exit status 0 when what was asked for was done, whatever came out; 2 for bad input, which one line
on stderr explains.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

import dynacom
from dynacom.errors import DynacomError

# Nothing of rich is imported here, nor by `import dynacom`: --version and --help shall not wait.

app = typer.Typer(
    help="Centroidal dynamics of legged robots, and how their contacts share the ground's wrench.",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,  # which would take units, [rad/s], for markup
    pretty_exceptions_enable=False,
)


def main() -> None:
    """Runs the command with the arguments of the process, and exits."""
    try:
        app(prog_name="dynacom")
    except (DynacomError, ValueError, KeyError, OSError) as error:
        # str(KeyError) is the repr of its argument.
        message = error.args[0] if isinstance(error, KeyError) else error
        typer.echo(f"dynacom: {DynacomError(str(message))}", err=True)
        sys.exit(2)


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"dynacom {dynacom.__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and exit."
        ),
    ] = False,
) -> None:
    pass


@app.command()
def robots() -> None:
    """List the robots that come with DynaCoM: name, URDF, contacts."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from dynacom.robots import list_robots, read_robot_file

    table = Table()
    for title in ("Robot", "URDF", "Contacts"):
        table.add_column(title, overflow="fold")
    for path in list_robots():
        robot = read_robot_file(path)
        contacts = "\n".join(f"{contact.name} ({contact.kind})" for contact in robot.contacts)
        table.add_row(*map(escape, (robot.name, robot.urdf, contacts)))
    Console().print(table)


@app.command()
def analyze(
    motion: Annotated[
        Path, typer.Argument(metavar="MOTION", help="Motion: .npz with t, q, v, a and contacts.")
    ],
    robot: Annotated[
        str, typer.Option(metavar="NAME|FILE.yaml", help="Robot: see 'dynacom robots'.")
    ],
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder for the results, made if it is not there.")
    ],
    flat: Annotated[
        bool,
        typer.Option("--flat/--uneven", help="Is the ground flat and horizontal? See the CoP."),
    ] = True,
    omega: Annotated[
        float,
        typer.Option(
            metavar="W",
            help="Natural frequency of the virtual repellent point [rad/s]; "
            "0 for that of the CoM's mean height.",
        ),
    ] = 0.0,
    ground_height: Annotated[
        float, typer.Option(metavar="H", help="Height of the flat ground in the world [m].")
    ] = 0.0,
) -> None:
    """Analyse every frame of a motion, write DIR/frames.csv, print a summary."""
    from rich.console import Console

    from dynacom.report import results_folder, summarize, summary_table, write_frames

    subject = dynacom.load_robot(robot)
    clip = dynacom.read_motion(motion, subject)
    if clip.v is None or clip.a is None:
        raise DynacomError(f"{motion}: missing velocities and accelerations")
    if clip.schedule is None:
        raise DynacomError(f"{motion}: missing arrays 'contacts' and 'contact_names'")
    frames, schedule = dynacom.Motion(clip.time, clip.q, clip.v, clip.a), clip.schedule

    dynamics = subject.dynacom()
    dynamics.setGroundHeight(ground_height)
    try:
        with _progress(len(frames.time)) as progress:
            analysis = dynacom.analyzeMotion(
                dynamics, frames, schedule, flat, omega=omega, progress=progress
            )
    except ValueError as error:
        raise DynacomError(f"{motion}: {error}") from error

    try:
        with results_folder(out) as folder:
            write_frames(analysis, folder / "frames.csv")
    except OSError as error:
        raise DynacomError(f"{out}: cannot be written ({error.strerror or error})") from error

    gravity = -float(subject.model.gravity.linear[2])
    console = Console()
    console.print(summary_table(summarize(analysis, dynamics.getMass(), gravity)))
    console.print(f"Wrote {out / 'frames.csv'}", highlight=False, markup=False, soft_wrap=True)


@contextmanager
def _progress(total: int) -> Iterator[Callable[[int], None]]:
    """A progress bar on stderr, if that is a terminal: a function that takes the frames done."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        ProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )
    from rich.text import Text

    class RateColumn(ProgressColumn):
        def render(self, task) -> Text:
            return Text(f"{task.finished_speed or task.speed or 0.0:.0f} frames/s")

    console = Console(stderr=True)
    if not console.is_terminal:
        # Not None: Python notices Ctrl-C in C++ code only when that calls it.
        yield lambda done: None
        return
    with Progress(
        TextColumn("Analysing"),
        BarColumn(),
        MofNCompleteColumn(),
        RateColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    ) as bar:
        task = bar.add_task("", total=total)
        yield lambda done: bar.update(task, completed=done)
