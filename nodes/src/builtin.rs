//! The files that the catalogue brings along: `builtin:NAME` stands for one wherever a graph names a file.
//!
//! They are what ships under `graphs/`, so that an example on any page runs in any folder.

use tactflow_runtime::source::BuiltinFile;

/// Every file, by its name behind `builtin:`.
pub const FILES: &[BuiltinFile] = &[
    ("finger_press.csv", include_bytes!("../../graphs/recordings/pressuRe/iscan_test.csv")),
    ("lwr4p.urdf", include_bytes!("../../graphs/robots/lwr4p.urdf")),
    ("lwr4p.toml", include_bytes!("../../graphs/robots/lwr4p.toml")),
    ("ur5e.urdf", include_bytes!("../../graphs/robots/ur5e.urdf")),
    ("ur5e.toml", include_bytes!("../../graphs/robots/ur5e.toml")),
    ("panda.urdf", include_bytes!("../../graphs/robots/panda.urdf")),
    ("panda.toml", include_bytes!("../../graphs/robots/panda.toml")),
    ("benches/simulated.toml", include_bytes!("../../graphs/benches/simulated.toml")),
    ("calibrations/sim_pad.toml", include_bytes!("../../graphs/calibrations/sim_pad.toml")),
    ("pads/flexitac_16x32.toml", include_bytes!("../../graphs/pads/flexitac_16x32.toml")),
    ("pads/flexitac_16x16.toml", include_bytes!("../../graphs/pads/flexitac_16x16.toml")),
    ("pads/flexitac_12x32.toml", include_bytes!("../../graphs/pads/flexitac_12x32.toml")),
    ("pads/aa550399_32x32.toml", include_bytes!("../../graphs/pads/aa550399_32x32.toml")),
    ("pads/aa550399_glove.toml", include_bytes!("../../graphs/pads/aa550399_glove.toml")),
    ("pads/anyskin.toml", include_bytes!("../../graphs/pads/anyskin.toml")),
    ("pads/velostat_ascii.toml", include_bytes!("../../graphs/pads/velostat_ascii.toml")),
    ("pads/velostat_binary.toml", include_bytes!("../../graphs/pads/velostat_binary.toml")),
    ("pads/myrmex_v2.toml", include_bytes!("../../graphs/pads/myrmex_v2.toml")),
    ("programs/wave_pad.node.toml", include_bytes!("../python/examples/wave_pad.node.toml")),
    ("look.toml", include_bytes!("../../graphs/look.toml")),
    ("parts/touch.toml", include_bytes!("../../graphs/parts/touch.toml")),
    ("parts/answer.toml", include_bytes!("../../graphs/parts/answer.toml")),
    ("parts/ruler.toml", include_bytes!("../../graphs/parts/ruler.toml")),
    ("parts/move.toml", include_bytes!("../../graphs/parts/move.toml")),
    ("parts/two_pad_move.toml", include_bytes!("../../graphs/parts/two_pad_move.toml")),
    ("parts/bare_move.toml", include_bytes!("../../graphs/parts/bare_move.toml")),
];
