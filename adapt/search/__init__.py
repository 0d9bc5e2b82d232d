"""Where the limb is, with nothing said of it: a first pose, the person's size, and which limb is meant.

``limb_segments`` finds long thin parts of a cloud, ``coarse_cost`` tries many placements of the skin on them,
``first_pose`` refines the best; ``pose_score`` says how well a pose explains its cloud, ``overall_size`` settles the
size. ``candidates`` does so for some frames of a recording. ``own_side``, ``one_leg``, ``other_limb`` and
``rival_side`` tell right from left, and one limb from another in sight.
"""
