//! `normal_image`: the image of one axis of a vector image.

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Image, VectorImage, VectorImageShape};

/// Takes the normal force of each tactel out of a vector image, as an image for all nodes that take one.
///
/// A pad with three axes also sends this image by itself, as it was read. Use this node for the normal forces after
/// `calibrate_vectors`, or for a program or a recording that has vector images alone. The tangential part is not lost: wire
/// the vector image to `shear` as well.
///
/// ```toml
/// [nodes.normal_image]
/// type = "normal_image"
/// in.vectors = "calibrate_vectors.vectors"
/// ```
#[derive(Describe)]
pub struct NormalImage;

/// Parameters of `normal_image`: none.
#[derive(Debug, Clone, Param)]
pub struct Params {}

/// What `normal_image` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The vector image.
    #[port(unit = "U", frame = "A", quantity = "three_axis_image")]
    vectors: In<'a, VectorImage>,
}

/// What `normal_image` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// z of each tactel: the force that presses it.
    #[port(unit = "U", frame = "A", quantity = "normal_image")]
    image: Out<Image>,
}

impl Node for NormalImage {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(_: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let VectorImageShape(shape) = setup.inputs.vectors.clone();
        setup.outputs.image = shape;
        Ok(Self)
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let cells = out.image.write().cells_mut();
        cells.iter_mut().zip(inputs.vectors.cells()).for_each(|(cell, [.., z])| *cell = *z);
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{ImageShape, Shape, Unit};

    use super::*;

    #[test]
    fn it_is_the_third_axis() {
        let shape = ImageShape { rows: 2, cols: 2, pitch: [0.004, 0.005], unit: Unit::NEWTON };
        let vectors = VectorImageShape(shape.clone());
        let mut rig = NodeRig::new::<NormalImage>("", &[("vectors", vectors.into())]).unwrap();
        assert_eq!(*rig.shape("image"), Shape::from(shape));
        let mut image = VectorImage::zeros(2, 2);
        image.cells_mut().copy_from_slice(&[[1.0, 2.0, 3.0], [4.0, 5.0, -6.0], [7.0, 8.0, 9.0], [0.0, 1.0, 0.0]]);
        rig.set("vectors", image);
        rig.step();
        assert_eq!(rig.get::<Image>("image").unwrap().cells(), [3.0, -6.0, 9.0, 0.0]);
    }
}
