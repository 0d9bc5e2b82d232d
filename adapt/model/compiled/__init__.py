"""The posed skin in compiled loops, for one body in pose after pose: what fitting and tracking spend their time on.

The equations are those of ``adapt.model.joints`` and ``adapt.model.deformers``. What does not depend on the pose is
laid out in arrays once for a body (``prepared``, ``at_rest``), then ``chain`` moves the bones, ``between`` the frames
between them, ``skin`` the skin. Tracking asks for derivatives by the pose alone; adapting also by the body's shape.
Tests hold all of it against the model's own blocks (``track.evaluation.skin_of_blocks``).
"""
