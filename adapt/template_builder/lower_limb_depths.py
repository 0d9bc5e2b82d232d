"""How deep the lower limb's bony borders lie beneath people's skin, and who measured it.

Two people's own bones under their own skin were measured as ``superficial`` measures a template; where a place was
measured on one leg alone, half as much more or less is allowed, which is what that person's two legs differ by at other
places. What nobody was found to have measured is an assumption, and says so.
"""

from __future__ import annotations

from adapt.template_builder.superficial import Spot

_RIGHT = "measured on the CT of the Visible Human Female (woman of 59), right leg"
_BOTH = "measured on the CT of the Visible Human Female (woman of 59), both legs"
_WITH_CALF = f"{_BOTH}, and on an MRI of a living adult's calf"
_HEAD = (
    f"{_RIGHT}, as 4.8 mm; NOT reached here: as much as 14 is let pass, because the skin would have to be drawn in by "
    "19 mm, into a pit beside the knee"
)
_ILIUM = (
    "ASSUMED: the iliac crest is felt under the skin along its whole length, so skin and fat alone lie over it; "
    "no measurement of their thickness in men of this build was found"
)


def _crest(percent: int, share: float, low: float, high: float, source: str) -> Spot:
    """The tibia's crest at a percentage of the bone's whole length, at ``share`` of the way between two landmarks."""
    name = f"tibial crest, {percent} %"
    return Spot(name, "tibia", "plateau_medial", low, high, source, to="MM", share=share, along=0.004, across=0.070)


SPOTS = (
    Spot("patella", "patella", "patella_apex", 0.0021, 0.0062, _RIGHT, to="patella_base", share=0.6, along=0.012),
    Spot("tibial tuberosity", "tibia", "tibial_tuberosity", 0.0026, 0.0061, _BOTH),
    _crest(25, 0.20, 0.0035, 0.0048, _WITH_CALF),
    _crest(50, 0.48, 0.0032, 0.0036, _WITH_CALF),
    _crest(75, 0.75, 0.0071, 0.0083, _BOTH),
    Spot("medial malleolus", "tibia", "MM", 0.0016, 0.0046, _BOTH),
    Spot("lateral malleolus", "tibia", "LM", 0.0018, 0.0022, _BOTH, along=0.012),
    Spot("fibular head", "tibia", "fibular_head", 0.0024, 0.0140, _HEAD),
    Spot("ASIS", "pelvis", "ASIS", 0.004, 0.020, _ILIUM),
    Spot("iliac crest, front", "pelvis", "ASIS", 0.004, 0.020, _ILIUM, to="PSIS", share=0.25, across=0.08),
    Spot("iliac crest, middle", "pelvis", "ASIS", 0.004, 0.020, _ILIUM, to="PSIS", share=0.5, across=0.08),
    Spot("iliac crest, back", "pelvis", "ASIS", 0.004, 0.020, _ILIUM, to="PSIS", share=0.75, across=0.08),
)

CLEARANCE = {"pelvis": 0.0030, "femur": 0.0040, "tibia": 0.0018, "patella": 0.0020, "foot": 0.0016}
"""How near (m) to the skin any vertex of a bone may come."""
