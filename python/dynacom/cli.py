# SPDX-License-Identifier: BSD-2-Clause
"""The command ``dynacom``.

Exit status 0 when what was asked for was done, whatever came out; 1 where ``--check`` asked whether
a motion is feasible, or at least repairable, and it is not, or nobody knows, and after ``repair``
still not; 2 for bad input, which one line on stderr explains.
"""

import functools
import inspect
import json
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer
from typer.core import TyperCommand

import dynacom
from dynacom.errors import DynacomError

if TYPE_CHECKING:
    from rich.console import Console

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
    # As Ctrl-C, so that nothing half-written stays behind.
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
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


_Clip = Annotated[
    Path,
    typer.Argument(metavar="CLIP", help="Motion: .csv, .npz, .parquet or .pkl, see docs/files.md."),
]


@dataclass(frozen=True)
class _Request:
    """The options that all commands have which judge motions."""

    robot: Annotated[
        str | None, typer.Option("--robot", metavar="NAME|FILE.yaml", help="See 'dynacom robots'.")
    ] = None
    urdf: Annotated[
        Path | None, typer.Option("--urdf", metavar="FILE", help="A robot without a robot file.")
    ] = None
    contact: Annotated[
        list[str] | None,
        typer.Option(
            "--contact",
            metavar="FRAME:KIND:KEY=VALUE,...",
            help="With --urdf: a contact, of kind point or 6d, such as "
            "sole:6d:half_length=0.1,half_width=0.05,mu=0.7,gu=0.05. May be repeated.",
        ),
    ] = None
    payload: Annotated[
        list[str] | None,
        typer.Option(
            "--payload",
            metavar="FRAME:MASS[@x,y,z]",
            help="A load that the robot carries [kg], [m]. May be repeated.",
        ),
    ] = None
    fps: Annotated[
        float | None, typer.Option(metavar="HZ", help="Frame rate, of files without times.")
    ] = None
    quat: Annotated[
        str | None,
        typer.Option(
            metavar="xyzw|wxyz", help="Order of quaternions, where the file does not say."
        ),
    ] = None
    trust: Annotated[
        bool,
        typer.Option("--trust", help="Read pickles that may run code as they are read."),
    ] = False
    cutoff: Annotated[
        str | None,
        typer.Option(
            metavar="HZ|auto",
            help="Cut-off of the filter where velocities and accelerations are computed; 0 for no "
            "filter. By itself: none for exact motions, 6 for others, less at low frame rates.",
        ),
    ] = None
    ground_height: Annotated[
        float | None,
        typer.Option(
            "--ground-height", metavar="H", help="Height of the ground [m]; else it is found."
        ),
    ] = None
    ground_velocity: Annotated[
        str | None,
        typer.Option(
            "--ground-velocity",
            metavar="X,Y,Z",
            help="Velocity of the ground, a treadmill's [m/s]; else it is found.",
        ),
    ] = None
    gravity: Annotated[
        float | None,
        typer.Option(
            "--gravity", metavar="G", help="Downward [m/s²]; 9.81 by default, 0 for none."
        ),
    ] = None
    feet_only: Annotated[
        bool,
        typer.Option(
            "--feet-only",
            help="Nothing but the robot's contacts touches the ground: no knees, no hands.",
        ),
    ] = False
    friction: Annotated[
        str | None,
        typer.Option(
            "--friction",
            metavar="cone|outer-pyramid|inner-pyramid|facets",
            help="What limits the friction of contacts that do not say otherwise; Coulomb's cone "
            "by default.",
        ),
    ] = None
    flat: Annotated[
        bool | None,
        typer.Option("--flat/--uneven", help="Is the ground flat and horizontal? See the CoP."),
    ] = None
    omega: Annotated[
        float | None,
        typer.Option(
            metavar="W",
            help="Natural frequency of VRP and DCM [rad/s]; 0 for that of the CoM's mean height.",
        ),
    ] = None
    distance: Annotated[
        bool | None,
        typer.Option(
            "--distance/--no-distance",
            help="Find how far motions are from feasible ones? None is repairable without.",
        ),
    ] = None
    preset: Annotated[
        str | None,
        typer.Option(
            "--preset",
            metavar="hicks|opensim|strict",
            help="Limits that others have published, see docs/verdict.md.",
        ),
    ] = None
    settings: Annotated[
        Path | None,
        typer.Option("--settings", metavar="FILE.yaml", help="Settings, see docs/verdict.md."),
    ] = None
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="A setting, such as verdict.residual_force.limit=0.2. May be repeated.",
        ),
    ] = None

    def reading(self) -> dict[str, Any]:
        """How files are to be read."""
        return {"fps": self.fps, "quat": self.quat, "trust": self.trust}

    def load_robot(self) -> "dynacom.Robot":
        from dynacom.robots import make_robot, parse_payload

        if (self.robot is None) == (self.urdf is None):
            got = "neither" if self.robot is None else "both"
            raise DynacomError(
                f"the robot must be given by --robot, or by --urdf and --contact, got {got}"
            )
        if self.urdf is None and self.contact:
            raise DynacomError("--contact goes with --urdf: a robot file has its own contacts")
        if self.urdf is None:
            robot = dynacom.load_robot(self.robot)
        else:
            robot = make_robot(self.urdf, self.contact or [])
        for text in self.payload or []:
            robot = robot.with_payload(*parse_payload(text))
        return robot if self.gravity is None else robot.with_gravity(self.gravity)

    def make_options(self, robot: "dynacom.Robot") -> "dynacom.AnalysisOptions":
        options = dynacom.AnalysisOptions()
        if self.preset is not None:
            options.update_from_preset(self.preset, robot)
        if self.settings is not None:
            options.update_from_file(self.settings)
        options.update_from_texts(self.set_ or [])
        if self.cutoff is not None:
            options.update_from_texts([f"cutoff={self.cutoff}"])
        values = {
            "friction": self.friction,
            "flat": self.flat,
            "omega": self.omega,
            "distance": self.distance,
        }
        given = {name: value for name, value in values.items() if value is not None}
        if self.feet_only:
            given["feet_only"] = True
        ground = {}
        if self.ground_height is not None:
            ground["ground_height"] = self.ground_height
        if self.ground_velocity is not None:
            ground["ground_velocity"] = _parse_velocity(self.ground_velocity)
        if ground:
            given["detection"] = ground
        options.update(given, "options")
        return options


@dataclass(frozen=True)
class _ClipRequest(_Request):
    """Those of the commands that judge one motion."""

    clip_name: Annotated[
        str | None,
        typer.Option("--clip", metavar="NAME", help="Which clip, where a pickle holds several."),
    ] = None
    schedule: Annotated[
        Path | None,
        typer.Option(metavar="FILE.yaml", help="When contacts are active, such as schedule.yaml."),
    ] = None

    def analyze(self, clip: Path) -> "dynacom.MotionReport":
        """Judges the motion, with a progress bar."""
        return self._run(dynacom.analyze, clip, "Analysing")

    def repair(self, clip: Path, **how: Any) -> "dynacom.RepairReport":
        """Repairs the motion, with a progress bar; `how` are arguments of :func:`repair`."""
        return self._run(dynacom.repair, clip, "Repairing", **how)

    def _run(self, function: Callable[..., Any], clip: Path, title: str, **others: Any) -> Any:
        robot = self.load_robot()
        options = self.make_options(robot)
        with _progress(title) as progress:
            return function(
                clip,
                robot,
                schedule=self.schedule,
                options=options,
                progress=progress,
                clip=self.clip_name,
                **self.reading(),
                **others,
            )


def _with_options(function: Callable[..., None]) -> Callable[..., None]:
    """A command that has an option for each field of its parameter `request`."""
    own = get_type_hints(function, include_extras=True)
    kind = own.pop("request")
    hints = get_type_hints(kind, include_extras=True)
    options = [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=field.default,
            annotation=hints[field.name],
        )
        for field in fields(kind)
    ]
    others = [
        parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=own[name])
        for name, parameter in inspect.signature(function).parameters.items()
        if name != "request"
    ]

    @functools.wraps(function)
    def command(**arguments: Any) -> None:
        given = {option.name: arguments.pop(option.name) for option in options}
        function(request=kind(**given), **arguments)

    command.__signature__ = inspect.Signature(options + others)
    command.__annotations__ = {p.name: p.annotation for p in options + others}
    return command


# What ``--check`` may ask for: the verdicts that pass, and outcomes of repair.
_CHECKS = {"feasible": ("feasible",), "repairable": ("feasible", "repairable")}


class _CheckCommand(TyperCommand):
    """A command whose option ``--check`` may stand without its value, which is then feasible."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        given = []
        for argument, following in zip_longest(args, args[1:]):
            given.append(argument)
            if argument == "--check" and following not in _CHECKS:
                given.append("feasible")
        return super().parse_args(ctx, given)


_Csv = Annotated[bool, typer.Option("--csv", help="Write frames.csv, too.")]
_Page = Annotated[
    bool, typer.Option("--page/--no-page", help="Write report.html? It takes the longest.")
]
_Check = Annotated[
    str | None,
    typer.Option(
        "--check",
        metavar="[feasible|repairable]",
        help="Exit with status 1 unless the motion is feasible, or at least repairable.",
    ),
]


def _require_check(check: str | None) -> None:
    if check not in (None, *_CHECKS):
        raise DynacomError(f"check must be {' or '.join(_CHECKS)}, got '{check}'")


def _default_folder(clip: Path, ending: str) -> Path:
    """Where you are, named after the clip."""
    return Path(f"{Path(clip.name.removesuffix('.gz')).stem}-{ending}")


def _print_files(console: "Console", files: Iterable[Path]) -> None:
    for file in files:
        console.print(f"Wrote {file}", highlight=False, markup=False, soft_wrap=True)


@app.command(cls=_CheckCommand)
@_with_options
def analyze(
    request: _ClipRequest,
    clip: _Clip,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder for the results, made if it is not there; CLIP-analysis, where you are, "
            "by default.",
        ),
    ] = None,
    csv: _Csv = False,
    page: _Page = True,
    check: _Check = None,
) -> None:
    """Judge a motion: is it physically possible, when not and why, what do the feet feel?

    Writes DIR/report.html, frames.parquet, summary.json and schedule.yaml, and prints a summary.
    """
    from rich.console import Console

    from dynacom.summary import summary_table

    _require_check(check)
    report = request.analyze(clip)
    with Console(stderr=True).status("Writing the results", spinner="line"):
        files = report.save(out or _default_folder(clip, "analysis"), csv=csv, page=page)
    console = Console()
    console.print(summary_table(report.summary))
    _print_files(console, files)
    if check is not None and report.verdict.outcome not in _CHECKS[check]:
        raise typer.Exit(1)


@app.command(cls=_CheckCommand)
@_with_options
def repair(
    request: _ClipRequest,
    clip: _Clip,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder for the motion and its report, made if it is not there; CLIP-repaired, "
            "where you are, by default.",
        ),
    ] = None,
    balance_only: Annotated[
        bool,
        typer.Option(
            "--balance-only", help="Look after forces only: not after feet, nor joints' limits."
        ),
    ] = False,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict", help="Mend single frames, too, of motions that are feasible as a whole."
        ),
    ] = False,
    stretch: Annotated[
        float | None,
        typer.Option(
            metavar="FACTOR", help="Slow the motion down, by at most this, if nothing else helps."
        ),
    ] = None,
    export_contacts: Annotated[
        bool,
        typer.Option(
            "--export-contacts", help="Write contacts.npz, for training: see docs/files.md."
        ),
    ] = False,
    csv: _Csv = False,
    page: _Page = True,
    check: _Check = None,
) -> None:
    """Make a motion feasible: the smallest change after which its contacts can give what it needs.

    Writes into DIR the motion, in the format of its file, and its report: report.html,
    frames.parquet, summary.json and schedule.yaml. Prints what was changed, and what could not be.
    """
    from rich.console import Console

    from dynacom.summary import repair_table

    _require_check(check)
    report = request.repair(clip, balance_only=balance_only, strict=strict, stretch=stretch)
    with Console(stderr=True).status("Writing the results", spinner="line"):
        folder = out or _default_folder(clip, "repaired")
        files = report.save(folder, csv=csv, page=page, export_contacts=export_contacts)
    # With what there was to say as the motion was written.
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    console = Console()
    console.print(repair_table(summary))
    _print_files(console, files)
    if check is not None and not _passes(summary["repair"], check):
        raise typer.Exit(1)


def _passes(repair: dict[str, Any], check: str) -> bool:
    """Whether what was written is what was asked for."""
    is_done = repair["outcome"] != "not repaired" or check == "repairable"
    return is_done and repair["verdict_written"] in _CHECKS[check]


@app.command()
@_with_options
def show(
    request: _ClipRequest,
    clip: _Clip,
    port: Annotated[int, typer.Option(help="Port of the viewer on this machine.")] = 8080,
) -> None:
    """Show a motion in a browser, with what its contacts feel, until Ctrl-C."""
    from dynacom import scene

    report = request.analyze(clip)
    scene.show(
        report.robot,
        report.motion.q,
        report.arrays,
        report.summary,
        port=port,
        announce=lambda url: typer.echo(f"Open {url} (Ctrl-C to stop)"),
    )


@app.command()
@_with_options
def batch(
    request: _Request,
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="PATHS...",
            help="Motions: files, folders to search, globs, URLs (s3://...), see docs/batch.md.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="Folder for the results, made if it is not there."),
    ],
    engine: Annotated[
        str, typer.Option(metavar="local|ray", help="Processes of this machine, or Ray Data.")
    ] = "local",
    jobs: Annotated[
        int | None, typer.Option(metavar="N", help="Processes; by default one per core.")
    ] = None,
    shard: Annotated[
        str | None, typer.Option(metavar="I/N", help="The Ith of N parts of the files only.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the batch in DIR: only what is left.")
    ] = False,
    frames: Annotated[
        bool, typer.Option("--frames", help="Write the table of each clip's frames, too.")
    ] = False,
    report: Annotated[
        int, typer.Option(metavar="N", help="Write a report of each of the N worst clips.")
    ] = 0,
    repair: Annotated[
        bool,
        typer.Option(
            "--repair",
            help="Write the motions to DIR/repaired, too: those that are feasible as they are, and "
            "those that can be repaired.",
        ),
    ] = False,
    balance_only: Annotated[
        bool,
        typer.Option(
            "--balance-only", help="With --repair: only what contacts can give, no feet, no joints."
        ),
    ] = False,
    strict: Annotated[
        bool,
        typer.Option(
            "--strict",
            help="With --repair: mend single frames, too, of motions that are feasible as a whole.",
        ),
    ] = False,
) -> None:
    """Judge many motions, and repair them: a row per clip, whatever the clip.

    Writes DIR/clips.parquet and DIR/index.html, and prints a summary.
    """
    from rich.console import Console

    from dynacom.batch import BatchProgress, run_batch
    from dynacom.summary import overview_table

    state = BatchProgress(0)

    def keep(now: BatchProgress) -> None:
        nonlocal state
        state = now
        show(now)

    robot = request.load_robot()
    options = request.make_options(robot)
    try:
        with _batch_progress() as show:
            found = run_batch(
                paths,
                robot,
                out,
                options=options,
                **request.reading(),
                engine=engine,
                jobs=jobs,
                shard=None if shard is None else _parse_shard(shard),
                resume=resume,
                frames=frames,
                report=report,
                repair=repair,
                balance_only=balance_only,
                strict=strict,
                progress=keep,
            )
    except KeyboardInterrupt:
        typer.echo(
            f"dynacom: interrupted when {state.done} of {state.files} files were done: the same "
            "command with --resume goes on",
            err=True,
        )
        raise typer.Exit(130) from None
    console = Console()
    console.print(overview_table(found, state))
    for name in ("clips.parquet", "index.html", *["repaired"] * repair):
        console.print(f"Wrote {out / name}", highlight=False, markup=False, soft_wrap=True)


def _parse_velocity(text: str) -> list[float]:
    try:
        x, y, z = (float(number) for number in text.split(","))
    except ValueError as error:
        raise DynacomError(f"--ground-velocity must be X,Y,Z in m/s, got '{text}'") from error
    return [x, y, z]


def _parse_shard(text: str) -> tuple[int, int]:
    part, slash, parts = text.partition("/")
    if not (slash and part.isdecimal() and parts.isdecimal()):
        raise DynacomError(f"shard must be i/n with i from 1 to n, got {text}")
    return int(part), int(parts)


@contextmanager
def _progress(title: str) -> Iterator[Callable[[float], None]]:
    """A progress bar on stderr, if that is a terminal: a function that takes the part done."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    if not console.is_terminal:
        # Not None: Python notices Ctrl-C in C++ code only when that calls it.
        yield lambda part: None
        return
    with Progress(
        TextColumn(title),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    ) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda part: bar.update(task, completed=part)


@contextmanager
def _batch_progress() -> Iterator[Callable[["dynacom.BatchProgress"], None]]:
    """A progress bar on stderr, if that is a terminal: a function that takes how far it is."""
    import time

    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda state: None
        return
    columns = (
        TextColumn("Judging"),
        BarColumn(),
        TextColumn("{task.description}"),
        TimeRemainingColumn(),
    )
    start = time.monotonic()

    def show(state: "dynacom.BatchProgress") -> None:
        elapsed = max(time.monotonic() - start, 1e-3)
        text = (
            f"{state.done}/{state.files} files, {state.clips / elapsed:.1f} clips/s, "
            f"{state.frames / elapsed:.0f} frames/s, {state.errors} errors"
        )
        bar.update(task, completed=state.done, total=state.files, description=text)

    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=1)
        yield show
