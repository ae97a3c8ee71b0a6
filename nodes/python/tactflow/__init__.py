"""Nodes and pads of tactflow in Python, and its recordings as arrays.

A node is a function. Its annotations name the kind and the unit of each port::

    import tactflow
    from tactflow import Image, Param, Scalar

    @tactflow.node
    def centre(image: Image["N"], floor: Param["N"] = 0.01) -> {"x": Scalar["m"]}:
        '''The centre of the force along x.'''
        force = image.cells.clip(floor) - floor
        total = force.sum()
        return {"x": None if total == 0.0 else (force.sum(axis=0) @ image.x) / total}

    if __name__ == "__main__":
        tactflow.main(centre)

``tactflow signature -- python3 centre.py`` writes the file that a graph needs. ``python3 centre.py --test run.mcap``
runs the function alone on a recording. ``docs/processes.md`` describes the protocol that this package speaks.
"""

from .ports import VERSION, Features, Flag, Frame, Image, Mask, Node, Param, Port, Scalar, Twist, VectorImage, node
from .program import main, pad
from .recordings import Recording, Series, open

__all__ = [
    "VERSION",
    "Features",
    "Flag",
    "Frame",
    "Image",
    "Mask",
    "Node",
    "Param",
    "Port",
    "Recording",
    "Scalar",
    "Series",
    "Twist",
    "VectorImage",
    "main",
    "node",
    "open",
    "pad",
]
