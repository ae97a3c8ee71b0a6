//! The bytes of values in recordings: little-endian numbers, and the size of the value before those of a kind with one.
//!
//! | kind | bytes |
//! |---|---|
//! | scalar | f64 |
//! | flag | u8 |
//! | features | u32 count; for each u8 present, f64 |
//! | image | u32 rows, u32 columns; f32 for each tactel, row by row |
//! | vector image | u32 rows, u32 columns; 3 f32 for each tactel, row by row |
//! | mask | u32 rows, u32 columns; the u64 words of each row |
//! | regions | u32 runs, u32 regions; u16 row, start, end, region for each run; u32 area, f64 force for each region |
//! | twist | 6 f64: linear, angular |
//! | pose | 12 f64: the rotation matrix column by column, the translation |
//! | joints | u32 count; f64 for each |
//! | jacobian | u32 count; 6 f64 for each |

use nalgebra::{Matrix3, Rotation3, Translation3, Vector6};

use super::{
    Arenas, Cells, Features, Flag, Image, Jacobian, Joints, Kind, Mask, Pose, Region, Regions, Run, Scalar, Shape,
    Signal, Twist, VectorImage,
};

/// Reads numbers from the front of bytes. Every method returns `None` when too few are left.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ByteReader<'b>(pub(crate) &'b [u8]);

impl<'b> ByteReader<'b> {
    /// Takes the first `count` bytes.
    pub(crate) fn take(&mut self, count: usize) -> Option<&'b [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.try_into().ok()
    }

    pub(crate) fn u8(&mut self) -> Option<u8> {
        self.array().map(u8::from_le_bytes)
    }

    pub(crate) fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    pub(crate) fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Option<u64> {
        self.array().map(u64::from_le_bytes)
    }

    pub(crate) fn i64(&mut self) -> Option<i64> {
        self.array().map(i64::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.array().map(f64::from_le_bytes)
    }

    /// Takes a text that is preceded by its length.
    pub(crate) fn text(&mut self) -> Option<&'b str> {
        let length = self.u32()? as usize;
        std::str::from_utf8(self.take(length)?).ok()
    }

    /// Takes the size of a value with `rows` by `cols` elements, if the elements of `bytes` each are there.
    fn size(&mut self, bytes: impl Fn(usize, usize) -> Option<usize>) -> Option<(usize, usize)> {
        let (rows, cols) = (self.u32()? as usize, self.u32()? as usize);
        bytes(rows, cols).filter(|bytes| *bytes <= self.0.len()).map(|_| (rows, cols))
    }

    /// Takes the number of elements of `bytes` each, if they are there.
    fn count(&mut self, bytes: usize) -> Option<usize> {
        let count = self.u32()? as usize;
        count.checked_mul(bytes).filter(|bytes| *bytes <= self.0.len()).map(|_| count)
    }

    fn f64s(&mut self, values: &mut [f64]) -> Option<()> {
        let bytes = self.take(8 * values.len())?;
        for (value, bytes) in values.iter_mut().zip(bytes.chunks_exact(8)) {
            *value = f64::from_le_bytes(bytes.try_into().ok()?);
        }
        Some(())
    }
}

/// Appends a text with its length before it.
pub(crate) fn put_text(out: &mut Vec<u8>, text: &str) {
    put_count(out, text.len());
    out.extend_from_slice(text.as_bytes());
}

fn put_count(out: &mut Vec<u8>, count: usize) {
    out.extend_from_slice(&(count as u32).to_le_bytes());
}

fn write_cells<T: bytemuck::Pod + Default>(image: &Cells<T>, out: &mut Vec<u8>) {
    put_count(out, image.rows());
    put_count(out, image.cols());
    out.extend_from_slice(bytemuck::cast_slice(image.cells()));
}

fn put_f64s(out: &mut Vec<u8>, values: &[f64]) {
    out.extend_from_slice(bytemuck::cast_slice(values));
}

const _: () = assert!(cfg!(target_endian = "little"), "slices of numbers are written as they are in memory");

impl Arenas {
    /// Appends the bytes of a value of `kind`. Allocates nothing if `out` has the capacity.
    pub(crate) fn write_bytes(&self, kind: Kind, slot: u32, out: &mut Vec<u8>) {
        let slot = slot as usize;
        match kind {
            Kind::Scalar => put_f64s(out, &[Scalar::arena(self)[slot]]),
            Kind::Flag => out.push(u8::from(Flag::arena(self)[slot])),
            Kind::Features => {
                let features = &Features::arena(self)[slot];
                put_count(out, features.components().len());
                for value in features.values() {
                    out.push(u8::from(value.is_some()));
                    put_f64s(out, &[value.unwrap_or_default()]);
                }
            }
            Kind::Image => write_cells(&Image::arena(self)[slot], out),
            Kind::VectorImage => write_cells(&VectorImage::arena(self)[slot], out),
            Kind::Mask => {
                let mask = &Mask::arena(self)[slot];
                put_count(out, mask.rows());
                put_count(out, mask.cols());
                out.extend_from_slice(bytemuck::cast_slice(mask.words()));
            }
            Kind::Regions => write_regions(&Regions::arena(self)[slot], out),
            Kind::Twist => put_f64s(out, Twist::arena(self)[slot].0.as_slice()),
            Kind::Pose => {
                let pose = &Pose::arena(self)[slot].0;
                put_f64s(out, pose.rotation.matrix().as_slice());
                put_f64s(out, pose.translation.vector.as_slice());
            }
            Kind::Joints => {
                let joints = &Joints::arena(self)[slot].0;
                put_count(out, joints.len());
                put_f64s(out, joints);
            }
            Kind::Jacobian => {
                let columns = &Jacobian::arena(self)[slot].0;
                put_count(out, columns.len());
                columns.iter().for_each(|column| put_f64s(out, column.0.as_slice()));
            }
        }
    }

    /// Replaces a value of `kind` by the one at the front of the bytes, which may have another size. Returns `None` if
    /// there is none.
    pub(crate) fn read_bytes(&mut self, kind: Kind, slot: u32, bytes: &mut ByteReader<'_>) -> Option<()> {
        let slot = slot as usize;
        match kind {
            Kind::Scalar => Scalar::arena_mut(self)[slot] = bytes.f64()?,
            Kind::Flag => Flag::arena_mut(self)[slot] = bytes.u8()? != 0,
            Kind::Features => {
                let count = bytes.count(9)?;
                let value = |bytes: &mut ByteReader<'_>| Some((bytes.u8()? != 0, bytes.f64()?));
                let values: Option<Vec<_>> = (0..count).map(|_| value(bytes)).collect();
                let values: Vec<_> =
                    values?.into_iter().map(|(is_present, value)| is_present.then_some(value)).collect();
                Features::arena_mut(self)[slot].fill(&values);
            }
            Kind::Image => read_cells(&mut Image::arena_mut(self)[slot], bytes)?,
            Kind::VectorImage => read_cells(&mut VectorImage::arena_mut(self)[slot], bytes)?,
            Kind::Mask => {
                let (rows, cols) = bytes.size(|rows, cols| rows.checked_mul(8 * cols.div_ceil(64)))?;
                let mask = &mut Mask::arena_mut(self)[slot];
                if (mask.rows(), mask.cols()) != (rows, cols) {
                    *mask = Mask::empty(rows, cols);
                }
                for word in mask.words_mut() {
                    *word = bytes.u64()?;
                }
            }
            Kind::Regions => read_regions(&mut Regions::arena_mut(self)[slot], bytes)?,
            Kind::Twist => bytes.f64s(Twist::arena_mut(self)[slot].0.as_mut_slice())?,
            Kind::Pose => {
                let (mut matrix, mut translation) = (Matrix3::zeros(), Translation3::identity());
                bytes.f64s(matrix.as_mut_slice())?;
                bytes.f64s(translation.vector.as_mut_slice())?;
                let pose = &mut Pose::arena_mut(self)[slot].0;
                (pose.rotation, pose.translation) = (Rotation3::from_matrix_unchecked(matrix), translation);
            }
            Kind::Joints => {
                let mut joints = Joints::zeros(bytes.count(8)?);
                bytes.f64s(&mut joints.0)?;
                Joints::arena_mut(self)[slot] = joints;
            }
            Kind::Jacobian => {
                let count = bytes.count(48)?;
                let mut column = |_| {
                    let mut column = Vector6::zeros();
                    bytes.f64s(column.as_mut_slice()).map(|()| Twist(column))
                };
                let columns: Option<Box<[Twist]>> = (0..count).map(&mut column).collect();
                Jacobian::arena_mut(self)[slot] = Jacobian(columns?);
            }
        }
        Some(())
    }
}

fn write_regions(regions: &Regions, out: &mut Vec<u8>) {
    put_count(out, regions.runs().len());
    put_count(out, regions.list().len());
    for Run { row, start, end, region } in regions.runs() {
        [row, start, end, region].into_iter().for_each(|number| out.extend_from_slice(&number.to_le_bytes()));
    }
    for Region { area, force } in regions.list() {
        out.extend_from_slice(&area.to_le_bytes());
        put_f64s(out, &[*force]);
    }
}

fn read_regions(regions: &mut Regions, bytes: &mut ByteReader<'_>) -> Option<()> {
    let size = |runs: usize, regions: usize| runs.checked_mul(8)?.checked_add(regions.checked_mul(12)?);
    let (runs, count) = bytes.size(size)?;
    let (run_list, region_list) = regions.parts_mut();
    run_list.clear();
    region_list.clear();
    for _ in 0..runs {
        let [row, start, end, region] = [bytes.u16()?, bytes.u16()?, bytes.u16()?, bytes.u16()?];
        run_list.push(Run { row, start, end, region });
    }
    for _ in 0..count {
        region_list.push(Region { area: bytes.u32()?, force: bytes.f64()? });
    }
    Some(())
}

fn read_cells<T: bytemuck::Pod + Default>(image: &mut Cells<T>, bytes: &mut ByteReader<'_>) -> Option<()> {
    let (rows, cols) = bytes.size(|rows, cols| rows.checked_mul(cols)?.checked_mul(size_of::<T>()))?;
    if (image.rows(), image.cols()) != (rows, cols) {
        *image = Cells::zeros(rows, cols);
    }
    let cells = bytes.take(size_of::<T>() * rows * cols)?;
    bytemuck::cast_slice_mut(image.cells_mut()).copy_from_slice(cells);
    Some(())
}

impl Shape {
    /// Returns the number of bytes of the longest value of this shape.
    pub(crate) fn max_bytes(&self) -> usize {
        if let Self::Regions(shape) = self {
            let runs = shape.grid.rows * shape.grid.cols.div_ceil(2);
            return 8 + runs * (8 + 12);
        }
        let mut arenas = Arenas::default();
        let (slot, mut bytes) = (arenas.add(self), Vec::new());
        arenas.write_bytes(self.kind(), slot, &mut bytes);
        bytes.len()
    }
}

#[cfg(test)]
mod tests {
    use super::super::{
        Feature, FeaturesShape, FlagShape, ImageShape, JacobianShape, Joint, JointsShape, MaskShape, PoseShape,
        RegionsShape, ScalarShape, Stamp, TwistShape, VectorImageShape,
    };
    use super::*;

    /// An arena with a value of each kind that is not zero, and its shape.
    fn values() -> (Arenas, Vec<Shape>) {
        let grid = MaskShape { rows: 3, cols: 70, pitch: [0.001; 2] };
        let joints = JointsShape { joints: vec![Joint::default(); 2], ..JointsShape::default() };
        let shapes: Vec<Shape> = vec![
            ScalarShape::default().into(),
            FlagShape.into(),
            FeaturesShape { features: vec![Feature::default(); 2] }.into(),
            ImageShape { rows: 2, cols: 3, ..ImageShape::default() }.into(),
            VectorImageShape(ImageShape { rows: 2, cols: 3, ..ImageShape::default() }).into(),
            grid.clone().into(),
            RegionsShape { grid, ..RegionsShape::default() }.into(),
            TwistShape.into(),
            PoseShape::default().into(),
            joints.clone().into(),
            JacobianShape(joints).into(),
        ];
        let mut arenas = Arenas::default();
        for shape in &shapes {
            arenas.add(shape);
        }
        Scalar::arena_mut(&mut arenas)[0] = -0.0;
        Flag::arena_mut(&mut arenas)[0] = true;
        Features::arena_mut(&mut arenas)[0].set(1, 0.1, 7, Stamp::TIMELESS);
        Image::arena_mut(&mut arenas)[0].cells_mut()[4] = 0.3;
        VectorImage::arena_mut(&mut arenas)[0].cells_mut()[5] = [0.0, -0.1, 0.3];
        Mask::arena_mut(&mut arenas)[0].insert(2, 69);
        let (runs, regions) = Regions::arena_mut(&mut arenas)[0].parts_mut();
        runs.push(Run { row: 2, start: 3, end: 69, region: 0 });
        regions.push(Region { area: 66, force: 1.5 });
        Twist::arena_mut(&mut arenas)[0].0[5] = f64::MIN_POSITIVE;
        Pose::arena_mut(&mut arenas)[0].0.rotation = Rotation3::from_euler_angles(0.1, 0.2, 0.3);
        Joints::arena_mut(&mut arenas)[0].0[1] = 1.0 / 3.0;
        Jacobian::arena_mut(&mut arenas)[0].0[1].0[2] = 2.0;
        (arenas, shapes)
    }

    fn bytes_of(arenas: &Arenas, kind: Kind) -> Vec<u8> {
        let mut bytes = Vec::new();
        arenas.write_bytes(kind, 0, &mut bytes);
        bytes
    }

    #[test]
    fn every_kind_comes_back_to_the_last_bit_and_fits_its_bound() {
        let (arenas, shapes) = values();
        assert!(Kind::ALL.iter().all(|kind| shapes.iter().any(|shape| shape.kind() == *kind)));
        let mut other = Arenas::default();
        for shape in &shapes {
            other.add(shape);
        }
        for shape in &shapes {
            let kind = shape.kind();
            let bytes = bytes_of(&arenas, kind);
            assert_ne!(bytes, bytes_of(&other, kind), "{kind}: the value is not zero");
            let mut reader = ByteReader(&bytes);
            assert_eq!(other.read_bytes(kind, 0, &mut reader), Some(()), "{kind}");
            assert!(reader.0.is_empty() && bytes_of(&other, kind) == bytes, "{kind}");
            assert!(bytes.len() <= shape.max_bytes(), "{kind}");
        }
    }

    #[test]
    fn bytes_that_end_too_early_are_no_value() {
        let (mut arenas, shapes) = values();
        for kind in shapes.iter().map(Shape::kind) {
            let bytes = bytes_of(&arenas, kind);
            for end in 0..bytes.len() {
                assert_eq!(arenas.clone().read_bytes(kind, 0, &mut ByteReader(&bytes[..end])), None, "{kind} {end}");
            }
            // A count that no file can hold must not be allocated.
            if ![Kind::Scalar, Kind::Flag, Kind::Twist, Kind::Pose].contains(&kind) {
                assert_eq!(arenas.read_bytes(kind, 0, &mut ByteReader(&[0xff; 64])), None, "{kind}");
            }
        }
    }

    #[test]
    fn an_image_of_another_size_keeps_its_size() {
        let (mut arenas, _) = values();
        Image::arena_mut(&mut arenas)[0] = Image::zeros(5, 7);
        let bytes = bytes_of(&arenas, Kind::Image);
        let (mut other, _) = values();
        assert_eq!(other.read_bytes(Kind::Image, 0, &mut ByteReader(&bytes)), Some(()));
        assert_eq!(other.size(Kind::Image, 0), [5, 7]);
    }
}
