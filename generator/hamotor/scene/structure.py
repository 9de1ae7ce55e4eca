"""Which methods suit a scene depends on its structure: the classes that were measured."""

from __future__ import annotations

from hamotor.scene.general import GeneralScene
from hamotor.scene.methods import Form
from hamotor.scene.model import Scene

STRUCTURES = {
    "free": "rigid bodies on which nothing acts",
    "planar": "rigid bodies in the plane, in potentials",
    "several": "several rigid bodies in potentials",
    "symmetric": "a symmetric rigid body in potentials: its free motion is known",
    "asymmetric": "an asymmetric rigid body in potentials",
    "field": "a rigid body in potentials that are neither gravity nor springs",
    "parts": "any group: a kinetic energy in parts whose motion is known, and a potential",
    "general": "any other Hamiltonian or Lagrangian",
    "forced": "forques that no potential has",
    "rough": "energies or forques that are not smooth",
}


def structure_of(scene: Scene | GeneralScene) -> str:
    """One of `STRUCTURES`."""
    if isinstance(scene, Scene):
        if scene.potential is not None and _is_rough(scene.general):
            return "rough"
        if scene.form & Form.FREE:
            return "free"
        if scene.group.dimension == 2:
            return "planar"
        if len(scene.bodies) > 1:
            return "several"
        if scene.potential is not None:
            return "field"
        moments = scene.principal[0].moments
        return "symmetric" if len(set(moments)) < len(moments) else "asymmetric"
    if _is_rough(scene):
        return "rough"
    if scene.form & Form.PARTS:
        return "parts"
    return "forced" if scene.hamiltonian.applied else "general"


def _is_rough(scene: GeneralScene) -> bool:
    import sympy

    h = scene.hamiltonian
    texts = [h.energy, *(x for forque in h.applied for x in forque)]
    return any(x.has(sympy.Abs, sympy.sign) for x in texts)
