"""Scenes: from a TOML file to a typed, checked `Scene`, and to its C++ source."""

from hamotor.scene.conserved import ConservedQuantity
from hamotor.scene.general import GeneralScene
from hamotor.scene.groups import GROUPS, Group
from hamotor.scene.interactions import Gravity, Interaction, Spring
from hamotor.scene.methods import (
    METHOD_NAMES,
    METHODS,
    Form,
    Promise,
    methods_offered,
    order_in_words,
)
from hamotor.scene.model import Body, Output, Scene, Time
from hamotor.scene.principal import PrincipalFrame
from hamotor.scene.reading import bundled_scenes, find_scene, folder_of, parse_scene, read_scene
from hamotor.scene.schema import scene_reference, starter_scene
from hamotor.scene.source import scene_source

__all__ = [
    "GROUPS",
    "METHODS",
    "METHOD_NAMES",
    "Body",
    "ConservedQuantity",
    "Form",
    "GeneralScene",
    "Gravity",
    "Group",
    "Interaction",
    "Output",
    "PrincipalFrame",
    "Promise",
    "Scene",
    "Spring",
    "Time",
    "bundled_scenes",
    "find_scene",
    "folder_of",
    "methods_offered",
    "order_in_words",
    "parse_scene",
    "read_scene",
    "scene_reference",
    "scene_source",
    "starter_scene",
]
