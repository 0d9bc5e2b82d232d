"""What people call coordinates and landmarks: the one table from the names in files to the words of a clinic.

Names keep to OpenSim's; beside them charts, tables and reports say what moves, what is counted positive and what zero
is. A coordinate's side (``_r``, ``_l``) is no part of its entry: a value means the same movement on both sides
(``adapt.mirror``). Coordinates that no anatomy that ships has yet, of a trunk and a shoulder girdle, have theirs, too;
of an anatomy of one's own the names themselves are told, with spaces.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PlainWords:
    """A coordinate in words: what moves (``name``), what a ``positive`` value is, and what ``zero`` is, if known."""

    name: str
    positive: str = ""
    zero: str = ""

    @property
    def label(self) -> str:
        """The name, with the positive direction where the name does not say it.

        >>> plain_words("knee_angle_r").label, plain_words("pro_sup").label
        ('knee flexion', 'forearm rotation (pronation +)')
        """
        told = not self.positive or self.positive in self.name
        return self.name if told else f"{self.name} ({self.positive} +)"


def plain_words(coordinate: str) -> PlainWords:
    """The words for a coordinate's name, with or without its side.

    >>> plain_words("elbow_flexion")
    PlainWords(name='elbow flexion', positive='flexion', zero='the straight arm')
    >>> plain_words("hip_rotation_l") == plain_words("hip_rotation_r")
    True
    >>> plain_words("tail_wag").label  # of somebody's own anatomy
    'tail wag'
    """
    found = _COORDINATES.get(coordinate) or _COORDINATES.get(without_side(coordinate))
    return found or PlainWords(coordinate.replace("_", " "))


def without_side(name: str) -> str:
    """A name without the side at its end.

    >>> without_side("knee_angle_l"), without_side("pro_sup")
    ('knee_angle', 'pro_sup')
    """
    return name[:-2] if name.endswith(("_r", "_l")) else name


def landmark_words(landmark: str) -> str:
    """A landmark spelled out.

    >>> landmark_words("EL"), landmark_words("MT5_head"), landmark_words("tail_tip")
    ('lateral epicondyle of the humerus', 'head of the fifth metatarsal', 'tail tip')
    """
    return _LANDMARKS.get(landmark, landmark.replace("_", " "))


def _placed(what: str, point: str, joint: str) -> dict[str, PlainWords]:
    """A free joint's six coordinates."""
    turns = {f"{joint}_r{c}": PlainWords(f"rotation vector of the {what}, {c}") for c in "xyz"}
    return turns | {f"{joint}_t{c}": PlainWords(f"{point}, {c}") for c in "xyz"}


_IN_LINE = "the hand in line with the forearm"
_UPRIGHT = "the thigh straight down from an upright pelvis"
_COORDINATES = {
    **_placed("humerus", "centre of the humeral head", "shoulder"),
    **_placed("pelvis", "centre of the hip", "hip"),
    **_placed("pelvis", "midpoint of the hips", "pelvis"),
    "elbow_flexion": PlainWords("elbow flexion", "flexion", "the straight arm"),
    "pro_sup": PlainWords("forearm rotation", "pronation", "the thumb forward in a hanging arm"),
    "deviation": PlainWords("wrist deviation", "ulnar deviation", _IN_LINE),
    "flexion": PlainWords("wrist flexion", "flexion", _IN_LINE),
    "wrist_deviation": PlainWords("wrist deviation", "ulnar deviation", _IN_LINE),
    "wrist_flexion": PlainWords("wrist flexion", "flexion", _IN_LINE),
    "hip_flexion": PlainWords("hip flexion", "flexion", _UPRIGHT),
    "hip_adduction": PlainWords("hip adduction", "adduction", _UPRIGHT),
    "hip_rotation": PlainWords("hip rotation", "inward rotation", "the knee pointing forward"),
    "knee_angle": PlainWords("knee flexion", "flexion", "the straight knee"),
    "ankle_angle": PlainWords("ankle flexion", "dorsiflexion", "the foot square to the shank"),
    "subtalar_angle": PlainWords("hindfoot rotation", "inversion", "the foot flat below the shank"),
    "mtp_angle": PlainWords("toe extension", "extension", "the toes in line with the foot"),
    "pelvis_tilt": PlainWords("pelvic tilt", "backward", "the upright pelvis"),
    "pelvis_list": PlainWords("pelvic list", "to the right side up", "the upright pelvis"),
    "pelvis_rotation": PlainWords("pelvic rotation", "to the left", "the pelvis facing forward"),
    "lumbar_bending": PlainWords("side bending of the lower back", "to the right", "the straight back"),
    "lumbar_extension": PlainWords("extension of the lower back", "extension", "the straight back"),
    "lumbar_twist": PlainWords("twist of the lower back", "to the left", "the straight back"),
    "thorax_bending": PlainWords("side bending of the chest", "to the right", "the straight back"),
    "thorax_extension": PlainWords("extension of the chest", "extension", "the straight back"),
    "thorax_twist": PlainWords("twist of the chest", "to the left", "the straight back"),
    "head_bending": PlainWords("side bending of the neck", "to the right", "the head upright"),
    "head_extension": PlainWords("extension of the neck", "extension", "the head upright"),
    "head_twist": PlainWords("turn of the head", "to the left", "the face forward"),
    "scapula_abduction": PlainWords("shoulder blade, about the chest", "abduction"),
    "scapula_elevation": PlainWords("shoulder blade, up and down", "elevation"),
    "scapula_upward_rot": PlainWords("upward rotation of the shoulder blade", "upward rotation"),
    "shoulder_x": PlainWords("shoulder, rotation vector x"),
    "shoulder_y": PlainWords("shoulder, rotation vector y"),
    "shoulder_z": PlainWords("shoulder, rotation vector z"),
}

_FINGERS = {"1": "thumb", "2": "index finger", "3": "middle finger", "4": "ring finger", "5": "little finger"}
_NTH = {"1": "first", "2": "second", "3": "third", "4": "fourth", "5": "fifth"}
_LANDMARKS = {
    "GH": "centre of the humeral head",
    "EM": "medial epicondyle of the humerus",
    "EL": "lateral epicondyle of the humerus",
    "olecranon": "olecranon",
    "US": "ulnar styloid",
    "RS": "radial styloid",
    "ulnar_head": "head of the ulna",
    "radial_head": "head of the radius",
    "thumb_tip": "tip of the thumb",
    **{f"finger{k}_tip": f"tip of the {name}" for k, name in _FINGERS.items()},
    **{f"MC{k}_{end}": f"{end} of the {nth} metacarpal" for k, nth in _NTH.items() for end in ("base", "head")},
    **{f"MT{k}_head": f"head of the {nth} metatarsal" for k, nth in _NTH.items()},
    **{f"toe{k}_tip": f"tip of the {nth} toe" for k, nth in _NTH.items()},
    "HJC": "centre of the hip joint",
    "ASIS": "anterior superior iliac spine",
    "PSIS": "posterior superior iliac spine",
    "iliac_crest": "iliac crest",
    "ischium": "ischial tuberosity",
    "pubis": "pubic bone",
    "trochanter": "greater trochanter",
    "FME": "medial epicondyle of the femur",
    "FLE": "lateral epicondyle of the femur",
    "patella_base": "upper edge of the kneecap",
    "patella_apex": "lower tip of the kneecap",
    "patella_medial": "medial edge of the kneecap",
    "patella_lateral": "lateral edge of the kneecap",
    "plateau_medial": "medial edge of the tibial plateau",
    "plateau_lateral": "lateral edge of the tibial plateau",
    "tibial_tuberosity": "tuberosity of the tibia",
    "fibular_head": "head of the fibula",
    "MM": "medial malleolus",
    "LM": "lateral malleolus",
}
