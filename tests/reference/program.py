"""Programs in C++ that measure, built once for the same text, headers and flags."""

from __future__ import annotations

import hashlib
import os
import subprocess
from pathlib import Path

from tests.reference.ulp import processor_can_fuse

ROOT = Path(__file__).resolve().parents[2]
BUILDS = ROOT / ".hamotor" / "build"


def program(source: Path) -> Path:
    """The compiled program, with fused multiply-adds where the processor has them."""
    fused = ["-mfma"] if processor_can_fuse() and os.uname().machine == "x86_64" else []
    flags = ["-std=gnu++20", "-O2", "-ffp-contract=off", *fused]
    identity = hashlib.sha256(" ".join(flags).encode())
    headers = [p for f in ("generated", "runtime/include") for p in (ROOT / f).rglob("*.hpp")]
    for path in (source, *sorted(headers)):
        identity.update(path.read_bytes())
    folder = BUILDS / source.stem
    target = folder / f"{source.stem}-{identity.hexdigest()[:16]}"
    if not target.exists():
        folder.mkdir(parents=True, exist_ok=True)
        for older in folder.glob(f"{source.stem}-{'?' * 16}"):
            older.unlink(missing_ok=True)
        unfinished = folder / f"{os.getpid()}-{target.name}"
        folders = [f"-I{ROOT / folder}" for folder in ("generated", "runtime/include")]
        command = ["g++", *flags, *folders, str(source), "-o", str(unfinished), "-lquadmath"]
        subprocess.run(command, check=True)
        unfinished.replace(target)
    return target
