"""What the network names: 19 joints, 15 parts of the body, and which are each other's mirror image."""

from __future__ import annotations

JOINTS = (
    "pelvis",
    "neck",
    "head",
    *(
        f"{joint}_{side}"
        for side in "lr"
        for joint in ("shoulder", "elbow", "wrist", "finger", "hip", "knee", "ankle", "toe")
    ),
)
"""The joint centres, in the network's order; ``_l`` and ``_r`` are the person's own left and right."""

PARTS = (
    "nothing",
    "head",
    "trunk",
    *(f"{part}_{side}" for part in ("upper_arm", "lower_arm", "hand", "thigh", "shank", "foot") for side in "lr"),
)
"""What a pixel may belong to, in the network's order: nothing is whatever is no person."""

LIMBS = {
    f"{limb}_{side}": tuple(PARTS.index(f"{part}_{side}") for part in parts)
    for limb, parts in (("arm", ("upper_arm", "lower_arm", "hand")), ("leg", ("thigh", "shank", "foot")))
    for side in "lr"
}
"""The parts of each limb."""


def other_side(name: str) -> str:
    """The mirror image of a joint or part.

    >>> other_side("elbow_l"), other_side("head")
    ('elbow_r', 'head')
    """
    return {"_l": name[:-1] + "r", "_r": name[:-1] + "l"}.get(name[-2:], name)


MIRRORED_JOINTS = tuple(JOINTS.index(other_side(joint)) for joint in JOINTS)
MIRRORED_PARTS = tuple(PARTS.index(other_side(part)) for part in PARTS)

LINKS = tuple(
    (JOINTS.index(a), JOINTS.index(b))
    for a, b in (
        ("pelvis", "neck"),
        ("neck", "head"),
        *(
            (f"{a}_{side}" if a not in ("neck", "pelvis") else a, f"{b}_{side}")
            for side in "lr"
            for a, b in (
                ("neck", "shoulder"),
                ("shoulder", "elbow"),
                ("elbow", "wrist"),
                ("wrist", "finger"),
                ("pelvis", "hip"),
                ("hip", "knee"),
                ("knee", "ankle"),
                ("ankle", "toe"),
            )
        ),
    )
)
"""Which joints a drawing joins by lines."""
