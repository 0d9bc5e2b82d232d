"""The network for the first pose: simulated depth images of MakeHuman's people, and the training on them.

Nothing here is needed to run the network (``adapt.search.figure``). Training needs the extra ``train``.
"""
