"""Scenes of rigid bodies, read by the functions that read every scene."""

from __future__ import annotations

import os

from hamotor import scene


def read_scene(name: str | os.PathLike[str]) -> scene.Scene:
    """The bundled scene, or the one in a file, of rigid bodies."""
    found = scene.read_scene(name)
    assert isinstance(found, scene.Scene)
    return found


def parse_scene(contents: bytes, *, name: str, file: str) -> scene.Scene:
    """The scene of rigid bodies that a TOML file holds."""
    found = scene.parse_scene(contents, name=name, file=file)
    assert isinstance(found, scene.Scene)
    return found


RIGID = [
    name for name, _ in scene.bundled_scenes() if isinstance(scene.read_scene(name), scene.Scene)
]
"""The bundled scenes of rigid bodies."""
