"""What the README shows of speed against error: its diagrams, table and reading.

    python -m hamotor.bench.readme runs/bench

draws the diagrams into `generator/pictures` from DIR/precision.json, and prints the text that
belongs to them, in which every figure is taken from there; and with DIR/steps.json a table of what
unrolled kernels are worth in whole steps.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from hamotor.bench.account import say
from hamotor.bench.precision_report import by_contestant, draw, meeting
from hamotor.bench.problems import ROOT
from hamotor.bench.steps import families_table, family_of
from hamotor.errors import UsageError

PICTURES: Final = ROOT / "generator" / "pictures"
SHOWN: Final = {"P4": "spring", "P3": "top", "P1": "free"}
"""Problems with the words for them."""


class Times:
    """The least times to each target, of families of ours and of public solvers."""

    def __init__(self, account: Mapping[str, Any], problem: str) -> None:
        norm = account["problems"][problem]["norm"]
        self.targets: Sequence[float] = account["targets"]
        self.ours: dict[str, dict[float, float]] = {}
        self.peers: dict[str, dict[float, float]] = {}
        for (of, _), ladder in by_contestant(account["rows"]).items():
            first = ladder[0]
            ours = first["family"] == "hamotor"
            if of != problem or (ours and first["form"]):
                continue
            who = family_of(first["contestant"]) if ours else first["contestant"]
            times = (self.ours if ours else self.peers).setdefault(who, {})
            for target in self.targets:
                for row in meeting(ladder, target, norm):
                    times[target] = min(times.get(target, row["best_us"]), row["best_us"])

    def best_of_ours(self, target: float, without: Sequence[str] = ()) -> float | None:
        """The least time of a family of ours that is not among `without`."""
        return min(
            (t[target] for who, t in self.ours.items() if who not in without and target in t),
            default=None,
        )

    def best_peer(self, target: float) -> float | None:
        """The least time of a public solver."""
        return min((t[target] for t in self.peers.values() if target in t), default=None)

    def ratios(self, family: str, *, to_peers: bool) -> Iterator[float]:
        """Of a family's time to that of the best public solver, or of the best of ours."""
        for target, time in self.ours.get(family, {}).items():
            other = self.best_peer(target) if to_peers else self.best_of_ours(target)
            if other is not None:
                yield time / other


def brief(number: float, digits: int) -> str:
    """`1400`, `2.1`: without an exponent."""
    return f"{float(f'{number:.{digits}g}'):,g}"


def in_words(ratios: Sequence[float]) -> str:
    """`2.1 to 5.6`, or one figure where they are the same."""
    low, high = (brief(x, 2) for x in (min(ratios), max(ratios)))
    return low if low == high else f"{low} to {high}"


def table(account: Mapping[str, Any]) -> list[str]:
    """Times of ours and of the fastest public solver, in Markdown."""
    targets = account["targets"]
    lines = [
        "| attitude error | " + " | ".join(f"{t:.0e}".replace("e-0", "e-") for t in targets) + " |",
        "|---" * (len(targets) + 1) + "|",
    ]
    for name, word in SHOWN.items():
        times = Times(account, name)
        cells = []
        for target in targets:
            ours, peer = times.best_of_ours(target), times.best_peer(target)
            cells.append(" / ".join("none" if t is None else brief(t, 3) for t in (ours, peer)))
        end = account["problems"][name]["end_s"]
        lines.append(f"| {word}, {end:g} s | " + " | ".join(cells) + " |")
    return lines


def reading(account: Mapping[str, Any]) -> list[str]:
    """What the figures say, and no more."""
    of = {name: Times(account, name) for name in SHOWN}
    free, spring = of["P1"], of["P4"]
    said = []
    without = [
        ours / peer
        for target in free.targets
        if (ours := free.best_of_ours(target, ("closed_form",))) is not None
        and (peer := free.best_peer(target)) is not None
    ]
    if without:
        said.append(
            "Without the closed form the free body takes us "
            f"{in_words(without)} times as long as the fastest public solver."
        )
    split = list(spring.ratios("splitting", to_peers=True))
    if split:
        said.append(
            f"For the spring, splittings take {in_words(split)} times as long as the fastest "
            "public solver; what they keep is the structure."
        )
    gauss = [r for times in of.values() for r in times.ratios("gauss", to_peers=False)]
    if gauss:
        said.append(
            f"Gauss collocation takes {in_words(gauss)} times as long as the fastest of ours."
        )
    slow = {
        who: [
            time / ours
            for target, time in spring.peers.get(who, {}).items()
            if (ours := spring.best_of_ours(target)) is not None
        ]
        for who in ("SciPy DOP853", "MuJoCo RK4", "Pinocchio RK4")
    }
    if any(slow.values()):
        said.append(
            "What is called from Python or made for contacts takes longer on it: "
            + ", ".join(f"{who} {in_words(found)} times" for who, found in slow.items() if found)
            + " the time of ours."
        )
    return said


def beyond_doubles(account: Mapping[str, Any]) -> str:
    """What errors cost that only scalars with more digits reach; "" where none does."""
    said = []
    for name, word in SHOWN.items():
        ways = [
            f"{found['target']:.0e} in {brief(found['ours']['us'] / 1000, 2)} ms "
            f"({found['ours']['name'].partition(',')[0].replace(' (', ' in ')})"
            for found in account["more_digits"]
            if found["problem"] == name
        ]
        if ways:
            said.append(f"{word} {' and '.join(dict.fromkeys([ways[0], ways[-1]]))}")
    return f"Beyond a double: {'; '.join(said)}." if said else ""


def text(account: Mapping[str, Any]) -> str:
    """The README's section."""
    lines = []
    for name, word in SHOWN.items():
        times = Times(account, name)
        ratios = [
            peer / ours
            for target in times.targets
            if (ours := times.best_of_ours(target)) is not None
            and (peer := times.best_peer(target)) is not None
        ]
        alt = f"{word}: error of the attitude against time"
        if ratios:
            alt += f"; the best public solver takes {in_words(ratios)} times as long as ours"
        lines += [f"![{alt}](generator/pictures/precision_{name}.png)", ""]
    measured = (
        "Time of ours and of the fastest public solver, µs for the whole motion, where the next "
        "two finer settings are as good (one process, best of the runs, "
        f"{account['provenance']['processor']}; compilation not counted):"
    )
    read = " ".join([*reading(account), beyond_doubles(account)]).strip()
    return "\n".join([*lines, measured, "", *table(account), "", read])


def main(arguments: Sequence[str]) -> int:
    """Draw and print what an account of all problems that are shown says."""
    folder = Path(arguments[0]) if arguments else Path("runs") / "bench"
    account = json.loads((folder / "precision.json").read_text(encoding="utf-8"))
    if missing := SHOWN.keys() - account["problems"].keys():
        raise UsageError(f"{folder}/precision.json has no {', '.join(sorted(missing))}")
    for name in SHOWN:
        for file in draw(account, name, [PICTURES / f"precision_{name}.png"]):
            say(f"wrote {file}")
    print(text(account))
    steps = folder / "steps.json"
    if steps.is_file():
        found = json.loads(steps.read_text(encoding="utf-8"))
        print("\n" + "\n".join(families_table(found["families"])))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
