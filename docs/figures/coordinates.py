"""The coordinates of an anatomy as a Markdown table, for docs/coordinates.md.

python docs/figures/coordinates.py
"""

from __future__ import annotations

import click
import numpy as np

from adapt.anatomy import Anatomy, Coordinate
from adapt.anatomy_file import load_anatomy
from adapt.model.pose_space import is_free

# What a positive value does, in the words of a clinic.
MEANING = {
    "shoulder_rx": "rotation vector of the humerus, x",
    "shoulder_ry": "rotation vector of the humerus, y",
    "shoulder_rz": "rotation vector of the humerus, z",
    "shoulder_tx": "centre of the humeral head, x",
    "shoulder_ty": "centre of the humeral head, y",
    "shoulder_tz": "centre of the humeral head, z",
    "elbow_flexion": "flexion; 0 is the straight arm",
    "pro_sup": "pronation; 0 is the thumb forward in a hanging arm",
    "deviation": "ulnar deviation",
    "flexion": "flexion towards the palm",
    "hip_rx": "rotation vector of the pelvis, x",
    "hip_ry": "rotation vector of the pelvis, y",
    "hip_rz": "rotation vector of the pelvis, z",
    "hip_tx": "centre of the hip, x",
    "hip_ty": "centre of the hip, y",
    "hip_tz": "centre of the hip, z",
    "hip_flexion_r": "flexion",
    "hip_adduction_r": "adduction",
    "hip_rotation_r": "inward rotation",
    "knee_angle_r": "flexion; 0 is the straight knee",
    "ankle_angle_r": "dorsiflexion",
}


def coordinate_table(anatomy: Anatomy) -> str:
    """Name, joint, unit, range and rest value of every coordinate, in the order of theta."""
    # Where joints share a coordinate, it is the first one's: the others follow.
    joint_of = {name: joint for joint in reversed(anatomy.joints) for name in joint.coordinates}
    lines = ["| coordinate | joint (type) | unit | range | at rest | positive means |", "|---|---|---|---|---|---|"]
    for coordinate in anatomy.coordinates:
        joint = joint_of[coordinate.name]
        limits = ("any", "-", "m" if coordinate.unit == "m" else "rad")
        low, rest, unit = limits if is_free(joint) else _degrees(coordinate)
        words = MEANING.get(coordinate.name, "")
        lines.append(f"| `{coordinate.name}` | {joint.name} ({joint.type}) | {unit} | {low} | {rest} | {words} |")
    return "\n".join(lines)


def _degrees(coordinate: Coordinate) -> tuple[str, str, str]:
    low, high, rest = np.rad2deg([coordinate.low, coordinate.high, coordinate.rest])
    return f"{low:.0f} to {high:.0f}°", f"{rest:.1f}°", "rad"


@click.command()
@click.option("--anatomy", default="upper-limb-right", show_default=True)
def main(anatomy: str) -> None:
    """Print the table."""
    click.echo(coordinate_table(load_anatomy(anatomy)))


if __name__ == "__main__":
    main()
