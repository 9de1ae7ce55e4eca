"""The command line: arguments in, a call of the API, text out.

Data goes to stdout, messages and progress to stderr.  Exit: 0 fine, 1 a check failed, 2 bad usage
or input, 3 the numerics failed, 4 a tool is missing or compilation failed, 130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from hamotor import __version__
from hamotor.errors import CheckFailed, HamotorError, UsageError, suggest

if TYPE_CHECKING:
    from hamotor.codegen.tree import Difference
    from hamotor.run.ensemble_run import EnsembleRun
    from hamotor.run.result import Run

Command = Callable[[argparse.Namespace], int]

_EXAMPLES = """\
examples:
  ./hamotor run dzhanibekov                 run a bundled scene; files go to runs/dzhanibekov
  ./hamotor run my.toml --end 5 --step 1e-3 --out somewhere
  ./hamotor run tumble --tolerance 1e-9 --json > tumble.json
  ./hamotor new > my.toml                   a commented scene to start from
  ./hamotor generate --signature 2,2,1 --name foo --out foo    a new algebra, ready to link
  ./hamotor show heavy_top                  what a scene models and conserves
  ./hamotor show pga3 gp motor motor        one generated kernel with its cost
  ./hamotor compare runs/a runs/b --tolerance 1e-9

exit codes: 0 fine, 1 a check failed, 2 bad usage or input, 3 the numerics failed,
            4 a tool is missing or compilation failed, 130 interrupted
"""

_RUN_EXAMPLES = """\
examples:
  ./hamotor run dzhanibekov
  ./hamotor run tumble --method rkmk4 --step 0.001 --end 100 --every 100
  ./hamotor run spring_pendulum --tolerance 1e-10 --csv --out runs/pendulum
  ./hamotor run heavy_top --end -5 --at=-1,-2.5,-5
  ./hamotor run tumbling_debris --ensemble 100000 --keep 0,7

The folder then holds run.json (the account of the run), trajectory/ (Parquet), path.png,
conserved.png and, where events of the scene happened, events.parquet; of an ensemble run.json,
statistics.parquet, states/, and where there are any failures.parquet and members/.  An earlier run
there is replaced, anything else is left alone.
"""

_BENCHMARKS = ("kernels", "steps", "precision", "stability", "ensemble")
_COMMANDS = ("run", "generate", "show", "table", "list", "new", "compare", "test", "bench")
_ENSEMBLE_OPTIONS = ("seed", "threads", "member", "keep", "engine", "scheduler")
_NOT_FOR_ENSEMBLES = {
    "tolerance": "it is verified for single runs; give --step or --local-tolerance",
    "digits": "members are stepped in double or float",
    "kernels": "only generated kernels step members",
    "representation": "only motors step members",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.  Prints no traceback for what users can cause."""
    try:
        code = _dispatch(list(sys.argv[1:] if arguments is None else arguments))
        sys.stdout.flush()
        return code
    except HamotorError as error:
        _say(f"hamotor: error: {error}")
        return error.exit_code
    except KeyboardInterrupt:
        _say("hamotor: interrupted")
        return 130
    except BrokenPipeError:
        # The reader of our output has seen enough.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        _say(f"hamotor: error: {error}")
        return 2


def _dispatch(words: list[str]) -> int:
    parser = _parser()
    if not words:
        parser.print_help(sys.stderr)
        return 2
    if not words[0].startswith("-") and words[0] not in _COMMANDS:
        _refuse_command(words[0])
    parsed = parser.parse_args(words)
    command: Command = parsed.command
    return command(parsed)


def _refuse_command(word: str) -> NoReturn:
    raise UsageError(
        f'unknown command "{word}"; commands are {", ".join(_COMMANDS)}.{suggest(word, _COMMANDS)}'
    )


def _program_name() -> str:
    """As the user called it: by the launcher of a checkout, or as an installed command."""
    started = Path(sys.argv[0]).name
    return "./hamotor" if started == "__main__.py" else started


class _Parser(argparse.ArgumentParser):
    """argparse with our kind of error: one line, and a suggestion for a mistyped option."""

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message[:1].lower()}{message[1:]}; see {self.prog} --help")

    def parse_known_args(  # type: ignore[no-untyped-def]
        self, args=None, namespace=None
    ):
        parsed, unknown = super().parse_known_args(args, namespace)
        for word in unknown:
            if word.startswith("-"):
                options = [o for action in self._actions for o in action.option_strings]
                option = word.partition("=")[0]
                hint = suggest(option, options)
                raise UsageError(f"unknown option {option}.{hint} See {self.prog} --help")
        return parsed, unknown


def _parser() -> _Parser:
    parser = _Parser(
        prog=_program_name(),
        description="Hamiltonian mechanics on rotor groups, as generated C++.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"hamotor {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=_Parser)

    def command(name: str, what: str, run: Command, epilog: str = "") -> _Parser:
        made: _Parser = commands.add_parser(
            name,
            help=what,
            description=what[:1].upper() + what[1:] + ".",
            epilog=epilog,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        made.set_defaults(command=run)
        return made

    _add_run(command("run", "integrate a scene", _run, _RUN_EXAMPLES))
    _add_generate(command("generate", "write the generated C++ of algebras", _generate))
    show = command(
        "show", "explain a scene (SCENE) or print one kernel (ALGEBRA PRODUCT OPERAND…)", _show
    )
    show.add_argument("what", metavar="SCENE | ALGEBRA", help="a scene, or an algebra")
    show.add_argument("words", metavar="PRODUCT OPERAND", nargs="*", help="product and operands")
    table = command("table", "print the Cayley table of a product", _table)
    table.add_argument("algebra", metavar="ALGEBRA")
    table.add_argument("product", metavar="PRODUCT")
    listing = command("list", "list what there is", _list)
    listing.add_argument("what", metavar="algebras|scenes|methods")
    new = command("new", "print a commented starter file to stdout", _new)
    new.add_argument("what", metavar="scene|algebra", nargs="?", default="scene")
    new.add_argument("--signature", metavar="P,Q,R", type=_signature, help="of the algebra")
    _add_starter_options(new)
    compare = command("compare", "show how far two runs are apart", _compare)
    compare.add_argument("one", metavar="RUN", help="folder of a run")
    compare.add_argument("other", metavar="RUN", help="folder of another run")
    compare.add_argument(
        "--tolerance",
        metavar="E",
        type=_non_negative,
        help="exit with 1 if any difference, in its unit, is above E",
    )
    test = command("test", "run all checks and tests", _test)
    extent = test.add_mutually_exclusive_group()
    extent.add_argument("--fast", action="store_true", help="leave out what is slow")
    extent.add_argument(
        "--long", action="store_true", help="also what takes too long for every change"
    )
    test.add_argument(
        "--with-peers",
        action="store_true",
        help="install clifford, kingdon, GAlgebra and ganja.js first, to compare kernels with",
    )
    bench = command("bench", "measure speed and error against other libraries", _bench)
    bench.add_argument(
        "what", metavar="|".join(_BENCHMARKS), nargs="?", help="left out: a summary of two minutes"
    )
    bench.add_argument(
        "scenes", metavar="SCENE", nargs="*", help="which scenes; for stability: which cases"
    )
    bench.add_argument("--quick", action="store_true", help="fewer repetitions, scalars or methods")
    bench.add_argument("--out", metavar="DIR", help="where to write (default: runs/bench)")
    bench.add_argument("--json", action="store_true", help="print the account, not the table")
    bench.add_argument(
        "--with-peers",
        action="store_true",
        help="install heyoka, SciPy, MuJoCo, Pinocchio and Bullet (for ensemble: JAX and MuJoCo) "
        "first, to measure beside",
    )
    bench.add_argument(
        "--drift",
        metavar="N",
        type=_whole_number,
        help="for precision: steps of the long runs (default: a million; none if quick)",
    )
    return parser


def _add_run(parser: _Parser) -> None:
    parser.add_argument("scene", metavar="SCENE", help="a bundled scene, or the path of a file")
    parser.add_argument("--method", metavar="NAME", help="see: ./hamotor list methods")
    accuracy = parser.add_mutually_exclusive_group()
    accuracy.add_argument("--step", metavar="H", type=_positive, help="step, s")
    accuracy.add_argument(
        "--tolerance",
        metavar="E",
        type=_positive,
        help="an error of the final state of at most E, verified by a second, finer run; by the"
        " cheapest method unless --method names one",
    )
    parser.add_argument(
        "--local-tolerance",
        metavar="E",
        type=_positive,
        help="for methods that choose their steps: error per second; nothing is verified",
    )
    parser.add_argument(
        "--compensated",
        action=argparse.BooleanOptionalAction,
        help="whether sums over steps keep the digits that each addition would lose"
        " (default: where that costs the method little)",
    )
    parser.add_argument(
        "--end", metavar="T", type=_finite, help="end time, s; before 0: back in time"
    )
    rows = parser.add_mutually_exclusive_group()
    rows.add_argument("--every", metavar="N", type=_count, help="record every N-th step")
    rows.add_argument(
        "--at", metavar="T1,T2,...", type=_times, help="record at these times (s) and no others"
    )
    rows.add_argument(
        "--interval", metavar="T", type=_positive, help="record at the multiples of T, s"
    )
    parser.add_argument(
        "--time-limit",
        metavar="T",
        type=_positive,
        help="integrate for at most T seconds; what was computed is kept (exit 3)",
    )
    parser.add_argument(
        "--scalar", metavar="S", default="double", help="double|float|long_double|quad|mpfr"
    )
    parser.add_argument(
        "--digits", metavar="N", type=_count, help="of --scalar mpfr, at most 60 (default: 50)"
    )
    parser.add_argument(
        "--kernels",
        metavar="K",
        default="generated",
        help="generated|generic|sparse: by table, whole or what types need of it, to compare with",
    )
    parser.add_argument(
        "--out",
        metavar="DIR",
        help="where to write (default: runs/SCENE, of an ensemble runs/SCENE_ensemble)",
    )
    parser.add_argument("--csv", action="store_true", help="write trajectory.csv as well")
    parser.add_argument(
        "--json", action="store_true", help="print run.json on stdout, not the summary"
    )
    parser.add_argument("--no-pictures", action="store_true", help="draw nothing")
    parser.add_argument(
        "--representation",
        metavar="R",
        default="ga",
        help="ga|matrix: motors, or the classical R, x, Π, P (SE(3), SO(3), SE(2))",
    )
    many = parser.add_argument_group("many members of a scene, started as its [ensemble] says")
    many.add_argument("--ensemble", metavar="N", type=_count, help="how many")
    many.add_argument("--seed", metavar="S", type=_whole_number, help="of the random numbers")
    many.add_argument("--threads", metavar="T", type=_count, help="default: one for each core")
    many.add_argument(
        "--keep", metavar="K1,K2,...", type=_whole_numbers, help="members whose rows are written"
    )
    many.add_argument(
        "--member", metavar="K", type=_whole_number, help="this one alone: the same bits as in all"
    )
    many.add_argument(
        "--engine", metavar="E", choices=("local", "dask"), help="local|dask: who computes"
    )
    many.add_argument(
        "--scheduler", metavar="ADDRESS", help="of dask; left out: processes on this machine"
    )


def _add_generate(parser: _Parser) -> None:
    parser.add_argument("names", metavar="NAME", nargs="*", help="algebras (default: all bundled)")
    parser.add_argument(
        "--check", action="store_true", help="write nothing; exit with 1 if a file is out of date"
    )
    parser.add_argument("--out", metavar="DIR", help="write there instead of generated/")
    new = parser.add_argument_group("a new algebra, as a folder of its own; these need --out")
    new.add_argument(
        "--spec", metavar="FILE", help="generate from this spec (see: hamotor new algebra)"
    )
    new.add_argument(
        "--signature",
        metavar="P,Q,R",
        type=_signature,
        help="generate from numbers of positive, negative and null basis vectors",
    )
    _add_starter_options(new)


def _add_starter_options(group: argparse._ActionsContainer) -> None:
    group.add_argument(
        "--name", metavar="NAME", help="what the algebra is called (default: algebra)"
    )
    group.add_argument(
        "--null-pairs",
        metavar="N",
        type=_whole_number,
        help="replace N pairs of a positive and a negative vector by null vectors, product -1",
    )
    group.add_argument(
        "--products", metavar="A,B,...", help="only these operations (default: all that apply)"
    )


def _signature(text: str) -> tuple[int, int, int]:
    words = text.split(",")
    if len(words) != 3 or not all(word.strip().isdecimal() for word in words):
        raise argparse.ArgumentTypeError(f'must be three whole numbers P,Q,R, not "{text}"')
    p, q, r = (int(word) for word in words)
    return p, q, r


def _whole_number(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f'must be a whole number, at least 0, not "{text}"')
    return int(text)


def _starter_text(parsed: argparse.Namespace) -> str:
    from hamotor.codegen import starter_spec

    products = parsed.products.split(",") if parsed.products is not None else None
    return starter_spec(
        parsed.name or "algebra", parsed.signature, parsed.null_pairs or 0, products
    )


def _positive(text: str) -> float:
    number = _finite(text)
    if number <= 0:
        raise argparse.ArgumentTypeError(f'must be greater than zero, not "{text}"')
    return number


def _non_negative(text: str) -> float:
    number = _finite(text)
    if number < 0:
        raise argparse.ArgumentTypeError(f'must not be negative, not "{text}"')
    return number


def _finite(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'must be a number, not "{text}"') from None
    if number - number != 0:
        raise argparse.ArgumentTypeError(f'must be finite, not "{text}"')
    return number


def _whole_numbers(text: str) -> list[int]:
    return [_whole_number(word) for word in text.split(",")]


def _times(text: str) -> list[float]:
    return [_finite(word) for word in text.split(",")]


def _count(text: str) -> int:
    try:
        number = int(text)
    except ValueError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f'must be a whole number, at least 1, not "{text}"')
    return number


def _run(parsed: argparse.Namespace) -> int:
    if parsed.ensemble is not None:
        return _run_ensemble(parsed)
    for option in _ENSEMBLE_OPTIONS:
        if getattr(parsed, option) is not None:
            raise UsageError(f"--{option} goes with --ensemble N.")
    from hamotor.run.result import RunFailed, RunInterrupted
    from hamotor.run.simulation import load

    simulation = load(parsed.scene)
    out = parsed.out or str(Path("runs") / simulation.name)
    code = 0
    try:
        run = simulation.run(
            end=parsed.end,
            step=parsed.step,
            tolerance=parsed.tolerance,
            local_tolerance=parsed.local_tolerance,
            method=parsed.method,
            compensated=parsed.compensated,
            every=parsed.every,
            times=parsed.at,
            interval=parsed.interval,
            time_limit=parsed.time_limit,
            scalar=parsed.scalar,
            digits=parsed.digits,
            kernels=parsed.kernels,
            representation=parsed.representation,
            out=out,
            csv=parsed.csv,
            pictures=not parsed.no_pictures,
            progress=True,
        )
    except RunFailed as failure:
        run, code = failure.run, failure.exit_code
        _say(f"hamotor: error: {failure}")
    except RunInterrupted as interruption:
        run, code = interruption.run, 130
        _say("hamotor: interrupted; what was computed is kept")
    _print_run(run, as_json=parsed.json)
    return code


def _run_ensemble(parsed: argparse.Namespace) -> int:
    defaults = {"kernels": "generated", "representation": "ga"}
    for name, why in _NOT_FOR_ENSEMBLES.items():
        if getattr(parsed, name) not in {None, defaults.get(name)}:
            raise UsageError(f"--{name.replace('_', '-')} is not for ensembles: {why}.")
    from hamotor.run.ensemble_run import EnsembleFailed, EnsembleInterrupted, run_ensemble
    from hamotor.run.simulation import load

    simulation = load(parsed.scene)
    code = 0
    try:
        run = run_ensemble(
            simulation,
            parsed.ensemble,
            seed=parsed.seed,
            member=parsed.member,
            keep=parsed.keep,
            threads=parsed.threads,
            engine=parsed.engine or "local",
            scheduler=parsed.scheduler,
            end=parsed.end,
            step=parsed.step,
            local_tolerance=parsed.local_tolerance,
            method=parsed.method,
            compensated=parsed.compensated,
            every=parsed.every,
            times=parsed.at,
            interval=parsed.interval,
            time_limit=parsed.time_limit,
            scalar=parsed.scalar,
            out=parsed.out or str(Path("runs") / f"{simulation.name}_ensemble"),
            csv=parsed.csv,
            pictures=not parsed.no_pictures,
            progress=True,
        )
    except EnsembleFailed as failure:
        run, code = failure.run, failure.exit_code
        _say(f"hamotor: error: {failure}")
    except EnsembleInterrupted as interruption:
        run, code = interruption.run, 130
        _say("hamotor: interrupted; what was computed is kept")
    _print_run(run, as_json=parsed.json)
    return code


def _print_run(run: Run | EnsembleRun, *, as_json: bool) -> None:
    if as_json:
        from hamotor.run.report import to_json

        sys.stdout.write(to_json(run.report))
    else:
        print(run.summary())


def _generate(parsed: argparse.Namespace) -> int:
    from hamotor.codegen import generate

    folder = Path(parsed.out) if parsed.out else None
    shown = str(folder) if folder else "generated"
    again = " ".join(["./hamotor generate", *parsed.names, *(["--out", shown] * bool(folder))])
    if parsed.spec or parsed.signature:
        differences = _generate_new(parsed, folder)
        again = "the same command without --check"
    else:
        for option in ("name", "null_pairs", "products"):
            if getattr(parsed, option) is not None:
                raise UsageError(f"--{option.replace('_', '-')} goes with --signature P,Q,R.")
        if files := [name for name in parsed.names if name.endswith(".toml")]:
            raise UsageError(f"{files[0]}: for a spec of your own: --spec {files[0]} --out DIR.")
        differences = generate(parsed.names, check=parsed.check, out=folder)
    if parsed.check and differences:
        listed = "\n".join(f"  {d.kind:<9} {shown}/{d.path}" for d in differences)
        raise CheckFailed(f"generated files are out of date:\n{listed}\nTo write them: {again}")
    for difference in differences:
        done = "removed" if difference.kind == "orphaned" else "wrote"
        print(f"{done} {shown}/{difference.path}")
    if not differences:
        print(f"{shown}/ is up to date")
    return 0


def _generate_new(parsed: argparse.Namespace, folder: Path | None) -> list[Difference]:
    from hamotor.codegen import generate_library

    if parsed.names or (parsed.spec and parsed.signature):
        raise UsageError(
            "generate: give names of bundled algebras, --spec FILE or --signature P,Q,R."
        )
    if folder is None:
        raise UsageError("generate: a new algebra needs --out DIR, the folder to write.")
    if parsed.signature:
        name = parsed.name or "algebra"
        return generate_library(_starter_text(parsed), f"{name}.toml", folder, check=parsed.check)
    from hamotor.codegen.spec import read_text

    path = Path(parsed.spec)
    return generate_library(read_text(path), path.name, folder, check=parsed.check)


def _show(parsed: argparse.Namespace) -> int:
    from hamotor.codegen import bundled_algebras

    if parsed.what in bundled_algebras():
        if not parsed.words:
            raise UsageError(
                f"show {parsed.what}: name a product and its operands, for example: "
                f"./hamotor show {parsed.what} gp motor motor"
            )
        from hamotor.codegen import show

        print(show(parsed.what, parsed.words[0], parsed.words[1:]))
        return 0
    from hamotor.run.account import account
    from hamotor.scene import bundled_scenes, read_scene

    names = [name for name, _ in bundled_scenes()]
    known = [*bundled_algebras(), *names]
    if parsed.what not in names and not Path(parsed.what).exists():
        raise UsageError(
            f'"{parsed.what}" is neither an algebra ({", ".join(bundled_algebras())}) nor a scene '
            f"({', '.join(names)}) nor a file.{suggest(parsed.what, known)}"
        )
    if parsed.words:
        print(_equations(parsed.what, parsed.words), end="")
        return 0
    print(account(read_scene(parsed.what)))
    return 0


def _equations(scene: str, words: Sequence[str]) -> str:
    """`equations`, and then in any order `ga` or `classical`, `text` or `latex`."""
    from hamotor.mechanics.equations import FORMS, STYLES, equations
    from hamotor.scene import GeneralScene, read_scene

    allowed = ("equations", *FORMS, *STYLES)
    for word in words:
        if word not in allowed or words[0] != "equations":
            raise UsageError(
                f'show SCENE: unknown "{word}"; write equations [ga|classical] [text|latex].'
                f"{suggest(word, allowed)}"
            )
    form = "classical" if "classical" in words else "ga"
    style = "latex" if "latex" in words else "text"
    found = read_scene(scene)
    if isinstance(found, GeneralScene) and found.lagrangian is not None:
        raise UsageError(
            f"{found.name}: no formula inverts ∂L/∂B, so that there is no H to print;"
            " its rates are found by Newton's method"
        )
    return equations(found.hamiltonian, form, style)


def _table(parsed: argparse.Namespace) -> int:
    from hamotor.codegen import table

    print(table(parsed.algebra, parsed.product))
    return 0


def _list(parsed: argparse.Namespace) -> int:
    listings = {"algebras": _algebras, "scenes": _scenes, "methods": _methods}
    if parsed.what not in listings:
        raise UsageError(
            f'nothing to list under "{parsed.what}"; there are {", ".join(listings)}.'
            f"{suggest(parsed.what, listings)}"
        )
    entries = listings[parsed.what]()
    width = max((len(name) for name, _ in entries), default=0)
    for name, what in entries:
        print(f"{name.ljust(width)}  {what}".rstrip())
    return 0


def _algebras() -> list[tuple[str, str]]:
    from hamotor.codegen.spec import bundled_algebras, bundled_path, read_algebra

    return [(name, read_algebra(bundled_path(name)).description) for name in bundled_algebras()]


def _scenes() -> list[tuple[str, str]]:
    from hamotor.scene import bundled_scenes

    return bundled_scenes()


def _methods() -> list[tuple[str, str]]:
    from hamotor.scene import METHODS, order_in_words

    return [
        ("auto", "what suits the scene; run.json says which and why"),
        *((m.name, f"{order_in_words(m.order)}: {m.description}") for m in METHODS),
    ]


def _new(parsed: argparse.Namespace) -> int:
    if parsed.what == "scene":
        if parsed.signature:
            raise UsageError("new scene: --signature goes with new algebra.")
        from hamotor.scene import starter_scene

        print(starter_scene(), end="")
        return 0
    if parsed.what == "algebra":
        if parsed.signature:
            print(_starter_text(parsed), end="")
            return 0
        from hamotor.codegen.spec import bundled_path

        # A real one: the smallest algebra that is complete, with every key it can have.
        print(bundled_path("pga2").read_text(encoding="utf-8"), end="")
        return 0
    allowed = ("scene", "algebra")
    raise UsageError(
        f'no starter for "{parsed.what}"; there are scene and algebra.'
        f"{suggest(parsed.what, allowed)}"
    )


def _compare(parsed: argparse.Namespace) -> int:
    from hamotor.run.comparison import compare, table
    from hamotor.run.result import open_run

    comparison = compare(open_run(parsed.one), open_run(parsed.other))
    print(table(comparison))
    if parsed.tolerance is not None and not comparison.largest <= parsed.tolerance:
        raise CheckFailed(
            f"the runs differ by {comparison.largest:.3g}, more than {parsed.tolerance:g}."
        )
    return 0


def _test(parsed: argparse.Namespace) -> int:
    from hamotor.testing import run_tests

    return run_tests(parsed.fast, parsed.with_peers, parsed.long)


def _bench(parsed: argparse.Namespace) -> int:
    if parsed.what not in (None, *_BENCHMARKS):
        raise UsageError(
            f'no benchmark "{parsed.what}"; there are {", ".join(_BENCHMARKS)}.'
            + (
                suggest(parsed.what, _BENCHMARKS)
                or " Scenes come after it, as in bench precision P1."
            )
        )
    if parsed.drift is not None and parsed.what != "precision":
        raise UsageError("--drift is for the long runs of bench precision.")
    if parsed.with_peers and parsed.what in {"kernels", "steps", "stability"}:
        raise UsageError(f"bench {parsed.what} has no peers to install; leave --with-peers out.")
    from hamotor.bench import (
        bench_ensemble,
        bench_kernels,
        bench_precision,
        bench_stability,
        bench_steps,
        bench_summary,
    )

    out = Path(parsed.out) if parsed.out else Path("runs") / "bench"
    if out.exists() and not out.is_dir():
        raise UsageError(f"{out}: is not a folder")
    if parsed.what is None:
        bench_summary(out, json=parsed.json, with_peers=parsed.with_peers)
        return 0
    if parsed.what == "steps":
        bench_steps(parsed.scenes, out, json=parsed.json, quick=parsed.quick)
        return 0
    if parsed.what == "precision":
        bench_precision(
            parsed.scenes,
            out,
            json=parsed.json,
            quick=parsed.quick,
            with_peers=parsed.with_peers,
            drift=parsed.drift,
        )
        return 0
    if parsed.what == "stability":
        found = bench_stability(parsed.scenes, out, json=parsed.json, quick=parsed.quick)
        return 1 if found["failed"] else 0
    if parsed.scenes:
        raise UsageError(f"bench {parsed.what} takes no scenes; the other benchmarks do.")
    if parsed.what == "ensemble":
        bench_ensemble(out, json=parsed.json, quick=parsed.quick, with_peers=parsed.with_peers)
        return 0
    bench_kernels(out, json=parsed.json, quick=parsed.quick)
    return 0


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
