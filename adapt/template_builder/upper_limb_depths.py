"""How deep the upper limb's bony borders are taken to lie beneath people's skin.

No person's arm bones under that person's own skin were at hand, and no measurement of these depths was found. So all of
them are assumptions: where skin and fascia alone lie over a bone, it is taken to be about as deep as where the same
is so of the tibia, 3.2 to 4.8 mm in the two people who were measured.
"""

from __future__ import annotations

from adapt.template_builder.superficial import Spot

_FACE = (
    "ASSUMED to be about as deep as the tibia's subcutaneous face (3.2 to 4.8 mm in two people): skin and fascia alone "
    "lie over it; no measurement was found"
)
_BURSA = f"{_FACE}; a bursa or a tendon's edge may lie between"
_TENDONS = (
    "ASSUMED to be deeper than where skin and fascia alone lie over bone, for the retinaculum and the extensors' "
    "tendons run over the back of the carpus; no measurement was found. So deep it stays under the skin of a bent wrist"
)


def _border(share: float) -> Spot:
    name = f"ulna's border, {100.0 * share:.0f} %"
    return Spot(name, "ulna", "olecranon", 0.0030, 0.0060, _FACE, to="US", share=share, across=0.030)


def _metacarpal(number: int, share: float) -> Spot:
    name, (start, end) = f"metacarpal {number}, {100.0 * share:.0f} %", (f"MC{number}_base", f"MC{number}_head")
    return Spot(name, "hand", start, 0.0020, 0.0060, _BURSA, to=end, share=share, along=0.005, across=0.014)


def _carpus(where: str, share: float) -> Spot:
    """All around the hand at one height of the carpus, of which the back and the sides are the shallowest."""
    name = f"carpus, towards the {where}"
    return Spot(name, "hand", "capitate", 0.0045, 0.0100, _TENDONS, to="MC3_head", share=share)


SPOTS = (
    Spot("medial epicondyle", "humerus", "EM", 0.0025, 0.0060, _FACE),
    Spot("lateral epicondyle", "humerus", "EL", 0.0025, 0.0060, _BURSA),
    Spot("olecranon", "ulna", "olecranon", 0.0025, 0.0060, _BURSA),
    *(_border(share) for share in (0.1, 0.25, 0.5, 0.75, 0.9)),
    Spot("ulnar styloid", "ulna", "US", 0.0025, 0.0060, _FACE),
    Spot("radial styloid", "radius", "RS", 0.0020, 0.0060, _BURSA, along=0.010),
    _carpus("radius", -0.15),
    _carpus("metacarpals", 0.02),
    *(_metacarpal(number, share) for number in (2, 3, 5) for share in (0.25, 0.75)),
)

CLEARANCE = {"humerus": 0.0025, "ulna": 0.0022, "radius": 0.0019, "hand": 0.0014}
"""How near (m) to the skin any vertex of a bone may come."""
