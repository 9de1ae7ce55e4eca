"""Programs in C++ that measure, built once for the same text, headers and flags."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILDS = ROOT / ".hamotor" / "build"
HEADERS = ("generated", "runtime/include", "tests/reference")


def processor_can_fuse() -> bool:
    """Whether programs built with hardware fused multiply-adds run here."""
    if platform.machine() != "x86_64":
        return True
    return " fma " in Path("/proc/cpuinfo").read_text(encoding="utf-8")


def program(source: Path, *, fused: bool) -> Path:
    """The compiled program; `fused`: with hardware fused multiply-adds."""
    native = ["-mfma"] if fused and platform.machine() == "x86_64" else []
    flags = ["-std=gnu++20", "-O2", "-ffp-contract=off", *native]
    identity = hashlib.sha256(" ".join(flags).encode())
    headers = [p for f in HEADERS for p in (ROOT / f).rglob("*.hpp")]
    for path in (source, *sorted(headers)):
        identity.update(path.read_bytes())
    folder = BUILDS / source.stem
    stem = f"{source.stem}-{'fma' if fused else 'plain'}"
    target = folder / f"{stem}-{identity.hexdigest()[:16]}"
    if not target.exists():
        folder.mkdir(parents=True, exist_ok=True)
        for older in folder.glob(f"{stem}-{'?' * 16}"):
            older.unlink(missing_ok=True)
        unfinished = folder / f"{os.getpid()}-{target.name}"
        folders = [f"-I{ROOT / folder}" for folder in ("generated", "runtime/include")]
        command = ["g++", *flags, *folders, str(source), "-o", str(unfinished), "-lquadmath"]
        subprocess.run(command, check=True)
        unfinished.replace(target)
    return target
