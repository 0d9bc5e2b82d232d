"""Whether the joints and deformers of an anatomy have the parts that their types need."""

from __future__ import annotations

from functools import lru_cache

from adapt.anatomy import Anatomy
from adapt.model.deformers import deformer_problem
from adapt.model.joints import arched_joint, joint_problem, units_of
from capture.errors import AnatomyError

_REMEDY = "mend the anatomy's data"


@lru_cache(maxsize=16)
def refuse_wrong_parts(anatomy: Anatomy) -> None:
    """Refuse an anatomy of which a joint or a deformer is none of its type; every body and every file is asked.

    Raises:
        AnatomyError: it names the joint, bone or deformer, what is wrong, and of an unknown type the known ones.
    """
    for joint in anatomy.joints:
        problem = joint_problem(joint)
        if problem is not None:
            raise AnatomyError(problem, where=f"joint {joint.name}", remedy=_REMEDY)
        for name, unit in zip(joint.coordinates, units_of(joint), strict=True):
            if anatomy.coordinates[anatomy.coordinate_index(name)].unit != unit:
                problem = f"its coordinate {name} must be in {unit}"
                raise AnatomyError(problem, where=f"joint {joint.name}", remedy=_REMEDY)
    for bone in anatomy.bones:
        if bone.along is not None and arched_joint(anatomy, bone.name) is None:
            problem = "its vertices ride on shares of an arc, and no curve leads to it"
            raise AnatomyError(problem, where=f"bone {bone.name}", remedy=_REMEDY)
    for deformer in anatomy.deformers:
        problem = deformer_problem(anatomy, deformer)
        if problem is not None:
            raise AnatomyError(problem, where=f"deformer {deformer.name}", remedy=_REMEDY)
