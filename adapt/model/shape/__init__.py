"""How bodies of one anatomy differ: the numbers of a shape, what is likely among them, what sizes they mean.

``handle_space``: one scale and one shift a joint, from the handles of the bones. ``prior``: how people differ from the
template. Nothing outside this folder knows in which order a shape's numbers stand.
"""
