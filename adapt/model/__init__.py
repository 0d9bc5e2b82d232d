"""The anatomy model v(theta, a, v_hat) of equation 5, from small blocks that carry their derivatives.

Read in this order: ``derivatives`` (a value and its partial derivatives), ``frames`` (landmarks to frames),
``joints`` (one file per joint type), ``pose_space`` (their coordinates together), ``kinematics`` (the chain),
``handles`` (anthropometric deformation), ``shape`` (how bodies differ), ``deformers`` (rigid, forearm, bend), ``body``
(all of it together).
"""
