"""How fast everything is, beside targets, plain NumPy, the first version, and other programs.

    python -m track.evaluation.benchmark [RECORDING] [--subject FILE] [--repeat 9] [--adapt] [--whole] [--page FILE]

``stages`` times the stages of a frame and the adaptation, ``others`` OpenSim and a non-rigid ICP on the same data,
``lenses`` what a lens with distortion costs, ``growth`` more frames, sensors and skin, ``processes`` whole commands
with their memory; ``page`` writes it all down.

``threadpoolctl`` holds numpy to one thread where it is installed; elsewhere set ``OMP_NUM_THREADS=1``. A recording
that has its truth beside it needs no subject: the person who was simulated is taken.
"""
