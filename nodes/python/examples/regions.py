"""Features of the largest contact with scikit-image: its orientation, its eccentricity and its solidity."""

import sys

import tactflow
from tactflow import Image, Param, Scalar

try:
    from skimage.measure import label, regionprops
except ImportError:
    sys.exit("this example needs scikit-image: pip install scikit-image")


@tactflow.node
def regions(image: Image["N"], threshold: Param["N", "What counts as touched."] = 0.02) -> {
    "orientation": Scalar["rad mod pi", "Angle of the major axis, from +x toward +y."],
    "eccentricity": Scalar["1", "0 for a circle, 1 for a line."],
    "solidity": Scalar["1", "Part of its convex hull that the contact fills."],
}:
    """The shape of the largest contact."""
    if image is None:
        return {}
    found = regionprops(label(image.cells > threshold))
    if not found:
        return {}
    largest = max(found, key=lambda region: region.area)
    # scikit-image measures from the rows; tactflow from the columns, which run along x.
    angle = 1.5707963267948966 - largest.orientation
    angle = angle - 3.141592653589793 if angle > 1.5707963267948966 else angle
    return {"orientation": angle, "eccentricity": largest.eccentricity, "solidity": largest.solidity}


if __name__ == "__main__":
    tactflow.main(regions)
