"""The posed skin in compiled loops, for one body in pose after pose: what fitting and tracking spend their time on.

The equations are those of ``adapt.model.joints`` and ``adapt.model.deformers``; only the pose varies here. What does
not depend on it is laid out in arrays once for a body (``prepared``), then ``chain`` moves the bones, ``skin`` the
skin. Tests hold both against the model's own blocks.
"""
