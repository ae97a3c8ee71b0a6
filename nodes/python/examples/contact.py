"""Where the contact is, and how hard it presses: the features of the hybrid task, in Python."""

import tactflow
from tactflow import Image, Mask, Scalar


@tactflow.node
def contact(
    image: Image["N", "The image of the pad."],
    region: Mask,
) -> {
    "x": Scalar["m", "Centre of the force along x."],
    "y": Scalar["m", "Centre of the force along y."],
    "pressure": Scalar["N/tactel", "Mean force on the tactels of the region."],
}:
    """The centre and the mean force of the contact region."""
    if image is None or region is None or not region.any():
        return {}
    force = image.cells * region
    total = float(force.sum())
    if total <= 0.0:
        return {}
    x, y = force.sum(axis=0) @ image.x, force.sum(axis=1) @ image.y
    return {"x": x / total, "y": y / total, "pressure": total / region.sum()}


if __name__ == "__main__":
    tactflow.main(contact)
