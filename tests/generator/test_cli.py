"""The command line: what it prints where, and its exit codes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from tests.generator.toy import ensemble_of_toys, toy

import hamotor
from hamotor import testing
from hamotor.cli import main
from hamotor.codegen import tree
from hamotor.run import simulation

PACKAGE = Path(hamotor.__file__).parents[1]


@pytest.fixture
def toy_scene(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """`run toy` and `run bad` work, and the current folder is a new one."""
    toys = {"toy": toy(), "bad": toy({"FAIL_AT": 501}, name="bad")}
    monkeypatch.setattr(simulation, "load", lambda name: toys[name])
    monkeypatch.chdir(tmp_path)
    return tmp_path


def started(*arguments: str, **options: Any) -> subprocess.Popen[str]:
    """`python -m hamotor` as a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "hamotor", *arguments],
        env={**os.environ, "PYTHONPATH": str(PACKAGE)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def test_an_ensemble_prints_its_summary_and_writes_into_runs(
    toy_scene: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    many = {"some": ensemble_of_toys(), "none": ensemble_of_toys({"FAIL_MEMBER": 7}, mean=-9.0)}
    monkeypatch.setattr(simulation, "load", lambda name: many[name])
    assert main(["run", "some", "--ensemble", "20", "--seed", "2", "--keep", "3,5"]) == 0
    printed = capsys.readouterr().out
    assert "20 members, seed 2" in printed
    assert "million steps of members a second" in printed
    assert "members/ (2 trajectories)" in printed
    folder = toy_scene / "runs" / "toy_ensemble"
    assert {p.name for p in folder.iterdir()} == {
        "run.json",
        "statistics.parquet",
        "states",
        "members",
        "cloud.png",
    }
    assert main(["run", "some", "--ensemble", "20", "--member", "3", "--json", "--out", "one"]) == 0
    assert json.loads(capsys.readouterr().out)["ensemble"]["first"] == 3
    assert main(["run", "none", "--ensemble", "20"]) == 3
    assert "every member failed" in capsys.readouterr().err


def test_run_prints_the_summary_and_writes_into_runs(
    toy_scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "toy"]) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith("toy · SE3 in pga3 · splitting2 (order 2)")
    assert {p.name for p in (toy_scene / "runs" / "toy").iterdir()} == {
        "run.json",
        "trajectory",
        "path.png",
        "conserved.png",
    }


def test_run_json_prints_the_document_and_nothing_else(
    toy_scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "toy", "--json", "--no-pictures", "--out", "here"]) == 0
    printed = capsys.readouterr().out
    assert printed == (toy_scene / "here" / "run.json").read_text()
    assert json.loads(printed)["scene"] == "toy"


def test_the_options_of_run_reach_the_run(
    toy_scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = "run toy --method euler --step 0.1 --end 2 --every 5 --csv --no-pictures --json"
    assert main(words.split()) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["method"], said["step"], said["t_end"]) == ("euler", 0.1, 2.0)
    assert (said["every"], said["rows"]) == (5, 5)
    assert {p.name for p in (toy_scene / "runs/toy").iterdir()} == {
        "run.json",
        "trajectory",
        "trajectory.csv",
    }
    assert main(["run", "toy", "--tolerance", "1e-6", "--json", "--no-pictures"]) == 0
    assert json.loads(capsys.readouterr().out)["tolerance"]["achieved"] <= 1e-6


def test_a_failed_run_exits_with_3_and_keeps_what_was_computed(
    toy_scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "bad"]) == 3
    printed = capsys.readouterr()
    assert "hamotor: error: bad: the state became non-finite in step 501" in printed.err
    assert "failed after 500 of 1,000 steps" in printed.out
    run = hamotor.open_run(toy_scene / "runs" / "bad")
    assert run.status == "failed"
    assert len(run.t) == 501
    assert (toy_scene / "runs" / "bad" / "conserved.png").exists()


def test_a_rejected_text_exits_with_4(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = toy(source=lambda _kernels, _scalar: "this is not C++")
    monkeypatch.setattr(simulation, "load", lambda _name: broken)
    monkeypatch.chdir(tmp_path)
    assert main(["run", "toy"]) == 4
    assert "error:" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("rnu", 'unknown command "rnu".*Did you mean "run"'),
        (
            "bench kernel",
            'no benchmark "kernel"; there are kernels, steps, precision, stability, ensemble. Did',
        ),
        ("run", "SCENE"),
        ("run toy --stpe 1", 'unknown option --stpe. Did you mean "--step"'),
        ("run toy --step 0", 'greater than zero, not "0"'),
        ("run toy --step nan", 'finite, not "nan"'),
        ("run toy --end soon", 'a number, not "soon"'),
        ("run toy --every 0", "at least 1"),
        ("run toy --every 1.5", "a whole number"),
        ("run toy --step 1 --tolerance 1", "not allowed with"),
        ("run toy --ensemble 10", "all members would be the same"),
        ("run toy --seed 1", "--seed goes with --ensemble N"),
        ("run toy --ensemble 2 --seed -1", 'at least 0, not "-1"'),
        ("run toy --ensemble 2 --tolerance 1", "it is verified for single runs"),
        ("run toy --engine dask", "--engine goes with --ensemble N"),
        ("run toy --kernels hand", 'unknown kernels "hand"'),
        ("run toy --scalar half", 'unknown scalar "half"'),
        ("run toy --method eular", 'unknown method "eular".*Did you mean "euler"'),
        ("run toy extra", "unrecognized arguments: extra"),
        ("generate --signature 3,0,1", "needs --out DIR"),
        ("generate mine.toml --out x", "mine.toml: for a spec of your own: --spec mine.toml"),
        ("generate --signature 3,0", "must be three whole numbers P,Q,R"),
        ("generate --signature 9,0,0 --out x", "8 are allowed"),
        ("generate --signature 2,0,1 --null-pairs 1 --out x", "null pair"),
        ("generate --signature 2,0,1 --products wedge --out x", 'unknown product "wedge"'),
        ("generate --name foo", "goes with --signature"),
        ("generate --spec no_such.toml --out x", "no_such.toml: not a readable file"),
        ("new scene --signature 2,0,1", "goes with new algebra"),
        ("generate pgb3", 'unknown algebra "pgb3".*Did you mean'),
        ("list scene", 'Did you mean "scenes"'),
        ("new scnee", 'Did you mean "scene"'),
        ("show dzanibekov", 'Did you mean "dzhanibekov"'),
        ("show pga3", "name a product and its operands"),
        ("show dzhanibekov equation", "unknown .equation.; write equations"),
        ("compare a b", "a holds no hamotor run"),
        ("compare a b --tolerance -1", "must not be negative"),
    ],
)
@pytest.mark.usefixtures("toy_scene")
def test_bad_usage_exits_with_2_and_one_message(
    words: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    import re

    assert main(words.split()) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert re.search(message, printed.err), printed.err
    said = printed.err.removeprefix("compiling toy …\n")
    assert said.startswith("hamotor: error: ")


def test_no_command_prints_the_help_and_exits_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert "examples:" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"]])
def test_help_shows_examples(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(words)
    assert caught.value.code == 0
    assert "./hamotor run dzhanibekov" in capsys.readouterr().out


def test_every_promised_command_has_a_help(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ["run", "generate", "show", "table", "list", "new", "compare", "test"]:
        with pytest.raises(SystemExit) as caught:
            main([command, "--help"])
        assert caught.value.code == 0
    assert "usage:" in capsys.readouterr().out


def test_version_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--version"])
    assert capsys.readouterr().out == f"hamotor {hamotor.__version__}\n"


def test_list_names_what_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    for what, expected in (
        ("algebras", "pga3"),
        ("scenes", "dzhanibekov"),
        ("methods", "splitting2"),
    ):
        assert main(["list", what]) == 0
        names = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
        assert expected in names


def test_the_methods_listed_are_those_a_run_may_name(
    capsys: pytest.CaptureFixture[str],
) -> None:
    from hamotor.scene import METHOD_NAMES, METHODS

    main(["list", "methods"])
    names = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert sorted(names) == sorted({*METHOD_NAMES, *(method.name for method in METHODS)})


def test_show_explains_a_scene(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "heavy_top"]) == 0
    printed = capsys.readouterr().out
    for part in ("group", "body top", "gravity", "conserved", "left out", "time"):
        assert part in printed


def test_show_prints_a_kernel_and_table_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", "pga3", "gp", "motor", "motor"]) == 0
    assert "Cost" in capsys.readouterr().out
    assert main(["table", "pga2", "gp"]) == 0
    assert "e12" in capsys.readouterr().out


def test_new_prints_a_scene_that_can_be_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from hamotor.scene import read_scene

    assert main(["new"]) == 0
    path = tmp_path / "mine.toml"
    path.write_text(capsys.readouterr().out)
    assert read_scene(path).name == "mine"


def test_new_algebra_prints_a_spec_that_can_be_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from hamotor.codegen import read_algebra

    assert main(["new", "algebra"]) == 0
    path = tmp_path / "pga2.toml"
    path.write_text(capsys.readouterr().out)
    assert read_algebra(path).name == "pga2"


def test_check_lists_what_differs_and_ends_with_the_command_that_writes_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = [tree.Difference("orphaned", "old.hpp"), tree.Difference("stale", "a.hpp")]
    monkeypatch.setattr(hamotor.codegen, "generate", lambda *_, **__: found)
    assert main(["generate", "--check"]) == 1
    message = capsys.readouterr().err
    assert "orphaned  generated/old.hpp" in message
    assert "stale     generated/a.hpp" in message
    assert message.endswith("To write them: ./hamotor generate\n")
    assert main(["generate"]) == 0
    assert capsys.readouterr().out == "removed generated/old.hpp\nwrote generated/a.hpp\n"
    monkeypatch.setattr(hamotor.codegen, "generate", lambda *_, **__: [])
    assert main(["generate", "--check"]) == 0


def test_compare_exits_with_1_above_the_tolerance(
    toy_scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert toy_scene.is_dir()
    for out, step in (("a", "0.01"), ("b", "0.005")):
        words = ["run", "toy", "--step", step, "--out", out, "--no-pictures"]
        assert main(words) == 0
    capsys.readouterr()
    assert main(["compare", "a", "b"]) == 0
    assert "position" in capsys.readouterr().out
    assert main(["compare", "a", "b", "--tolerance", "1e-3"]) == 0
    assert main(["compare", "a", "b", "--tolerance", "1e-9"]) == 1
    assert "more than 1e-09" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("bench P1", "as in bench precision P1"),
        ("bench --drift 5", "--drift is for"),
        ("bench kernels --with-peers", "no peers to install"),
    ],
)
def test_bench_says_what_does_not_belong_together(
    words: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words.split()) == 2
    assert said in capsys.readouterr().err


def test_test_runs_the_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []

    def run_tests(fast: bool, with_peers: bool, long: bool) -> int:
        calls.append((fast, with_peers, long))
        return 1

    monkeypatch.setattr(testing, "run_tests", run_tests)
    assert main(["test"]) == 1
    assert main(["test", "--fast"]) == 1
    assert main(["test", "--with-peers"]) == 1
    assert main(["test", "--long"]) == 1
    assert [sum(call) for call in calls] == [0, 1, 1, 1]
    assert [call.index(True) for call in calls[1:]] == [0, 1, 2]


def test_a_closed_pipe_is_no_error() -> None:
    process = started("list", "scenes")
    assert process.stdout is not None
    process.stdout.close()
    assert process.wait(timeout=60) == 0
    assert process.stderr is not None
    assert process.stderr.read() == ""
    process.stderr.close()


def test_ctrl_c_before_the_first_step_exits_with_130_and_no_traceback() -> None:
    code = "import time, hamotor.cli as c; c._dispatch = lambda w: time.sleep(60); c.main(['x'])"
    process = subprocess.Popen(
        [sys.executable, "-c", code.replace("c.main", "raise SystemExit(c.main") + ")"],
        env={**os.environ, "PYTHONPATH": str(PACKAGE)},
        stderr=subprocess.PIPE,
        text=True,
    )
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors == "hamotor: interrupted\n"


def test_listing_scenes_is_quick() -> None:
    begun = time.perf_counter()
    process = started("list", "scenes")
    process.communicate(timeout=60)
    assert process.returncode == 0
    assert time.perf_counter() - begun < 3.0
    code = (
        "import sys; from hamotor.cli import main; main(['list', 'scenes'])\n"
        "assert not {'sympy', 'jinja2', 'pyarrow', 'matplotlib'} & sys.modules.keys()"
    )
    subprocess.run(
        [sys.executable, "-c", code],
        check=True,
        env={**os.environ, "PYTHONPATH": str(PACKAGE)},
        stdout=subprocess.DEVNULL,
    )
