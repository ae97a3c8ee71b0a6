//! The catalogue of tactflow: one node per file, the devices, and the roles they fill.
//!
//! [`touch`] turns a tactile image into features, [`servo`] turns features into a twist of the sensor, [`arm`] turns
//! the twist into joint velocities, which [`limits`] keep within bounds; [`motion`] is the maths that they share.
//! [`flow`] gates, switches, delays, generates and shows signals of any kind. [`devices`] exchange samples and commands
//! with the outside.
//!
//! A graph runs from Rust on sources that a test feeds, in virtual time:
//!
//! ```
//! use tactflow_runtime::harness::{FedRole, GraphRig};
//! use tactflow_runtime::signal::{Image, ImageShape, Unit};
//!
//! let graph = r#"
//!     graph.clock = "pad"
//!     roles.pad = "tactile_pad"
//!     [nodes.source]
//!     type = "tactile_source"
//!     in.image = "pad.image"
//! "#;
//! let shape = ImageShape { rows: 2, cols: 2, pitch: [0.005; 2], unit: Unit::NEWTON };
//! let pad = FedRole::new("pad", "tactile_pad", 4.0).output("image", shape);
//! let mut rig = GraphRig::new(tactflow_nodes::catalogue(), graph, vec![pad])
//!     .unwrap_or_else(|report| panic!("{}", report.render(false)));
//!
//! rig.feed("pad.image", 0.0, Image::from_cells(2, &[0.5, 0.0, 0.0, 1.5]));
//! rig.tick(0.0)?;
//! assert_eq!(rig.get("source.sum"), Some(&2.0));
//! # Ok::<(), tactflow_runtime::fault::Fault>(())
//! ```

pub mod arm;
pub mod builtin;
pub mod calibration;
pub mod devices;
pub mod flow;
pub mod limits;
pub mod motion;
pub mod recordings;
pub mod roles;
pub mod servo;
pub mod sim;
#[cfg(feature = "cli")]
mod tool;
pub mod touch;
pub mod usual;
pub mod wires;

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::signal::{Scalar, Twist};

#[cfg(feature = "cli")]
pub use tool::tool;

/// The built-in files, the roles, the devices and the checks of whole graphs: one line each.
fn edge() -> Catalogue {
    let catalogue = Catalogue::new()
        .files(builtin::FILES)
        .role(roles::tactile_pad())
        .role(roles::three_axis_pad())
        .role(roles::velocity_arm())
        .role(roles::bare_arm())
        .role(roles::force_sensor())
        .role(roles::motion_guide())
        .role(roles::ground_truth())
        .role(roles::true_object())
        // The first that fills a role is the one that examples take.
        .device::<devices::mock_pad::MockPad>()
        .device::<devices::recording::Player>()
        .device::<devices::mock_arm::MockArm>()
        .device::<devices::mock_force::MockForce>()
        .device::<devices::mock_guide::MockGuide>()
        .device::<sim::bench::SimBench>()
        .device::<sim::pair::SimPair>()
        .device::<devices::lockstep::Lockstep>();
    #[cfg(feature = "mcap")]
    let catalogue = catalogue.device::<devices::replay::Replay>();
    #[cfg(not(feature = "mcap"))]
    let catalogue = catalogue.left_out(&["replay"], "build the tool with recordings: add `--features mcap`");
    #[cfg(feature = "drivers")]
    let catalogue = catalogue
        .device::<devices::stream::Stream>()
        .device::<devices::agni::Agni>()
        .device::<devices::lwr_fri::LwrFri>()
        .device::<devices::ur::Ur>();
    #[cfg(feature = "ros2")]
    let catalogue = catalogue
        .device::<devices::ros2::Ros2Pad>()
        .device::<devices::ros2::Ros2Force>()
        .device::<devices::ros2::Ros2Guide>()
        .device::<devices::ros2::Ros2Arm>();
    #[cfg(not(feature = "ros2"))]
    let catalogue = catalogue.left_out(
        &["ros2_pad", "ros2_force", "ros2_guide", "ros2_arm"],
        "build the tool with ROS 2: `cargo install --path nodes --features ros2` (docs/ros2.md)",
    );
    #[cfg(feature = "process")]
    let catalogue = catalogue.device::<devices::process::Process>();
    #[cfg(feature = "cli")]
    let catalogue = catalogue.lint(tool::lint);
    catalogue
}

/// The nodes that measure a contact, after the edge: one line each.
fn touch() -> Catalogue {
    edge()
        .group("touch: from a tactile image to features of the contact")
        .node::<touch::tactile_source::TactileSource>()
        .node::<touch::calibrate::Calibrate>()
        .node::<touch::binarize::Binarize>()
        .node::<touch::label::Label>()
        .node::<touch::select_region::SelectRegion>()
        .node::<touch::region_count::RegionCount>()
        .node::<touch::image_window::ImageWindow>()
        .node::<touch::moments::Moments>()
        .node::<touch::principal_axes::PrincipalAxes>()
        .node::<touch::eccentricity::Eccentricity>()
        .node::<touch::contact_area::ContactArea>()
        .node::<touch::hough::Hough>()
        .node::<touch::curvature::Curvature>()
        .node::<touch::calibrate_vectors::CalibrateVectors>()
        .node::<touch::normal_image::NormalImage>()
        .node::<touch::shear::Shear>()
        .node::<touch::friction_margin::FrictionMargin>()
        .node::<touch::moving_average::MovingAverage>()
        .node::<touch::low_pass::LowPass>()
        .node::<touch::median::Median>()
}

/// Everything there is: one line each.
pub fn catalogue() -> Catalogue {
    touch()
        .group("servo: from features to a twist of the sensor")
        .node::<servo::feature_error::FeatureError>()
        .node::<servo::deadband::Deadband>()
        .node::<servo::pid::Pid>()
        .node::<servo::stiffness_estimate::StiffnessEstimate>()
        .node::<servo::gain_schedule::GainSchedule>()
        .node::<servo::inverse_jacobian::InverseJacobian>()
        .node::<servo::projector::Projector>()
        .node::<servo::twist_source::TwistSource>()
        .node::<servo::guidance::Guidance>()
        .node::<servo::scan_guide::ScanGuide>()
        .node::<servo::ridge_guide::RidgeGuide>()
        .node::<servo::hold_pose::HoldPose>()
        .node::<servo::follow_path::FollowPath>()
        .node::<servo::follow_surface::FollowSurface>()
        .node::<servo::park::Park>()
        .node::<servo::arm_spring::ArmSpring>()
        .node::<servo::arm_damping::ArmDamping>()
        .node::<servo::pivot::Pivot>()
        .node::<servo::twist_adder::TwistAdder>()
        .node::<servo::compose_twist::ComposeTwist>()
        .node::<servo::edge_guard::EdgeGuard>()
        .node::<servo::adjoint::Adjoint>()
        .group("limits: the limiters that every motion must pass through on its way to an arm")
        .node::<limits::bumpless::Bumpless>()
        .node::<limits::lost_contact::LostContact>()
        .node::<limits::contact_limit::ContactLimit>()
        .node::<limits::second_contact_limit::SecondContactLimit>()
        .node::<limits::wrench_limit::WrenchLimit>()
        .node::<limits::workspace_limit::WorkspaceLimit>()
        .node::<limits::blind_limit::BlindLimit>()
        .node::<limits::twist_limit::TwistLimit>()
        .node::<limits::acceleration_limit::AccelerationLimit>()
        .node::<limits::joint_limit::JointLimit>()
        .group("arm: from a twist of the sensor to joint velocities, and poses")
        .node::<arm::arm_state::ArmState>()
        .node::<arm::contact_point::ContactPoint>()
        .node::<arm::static_pose::StaticPose>()
        .node::<arm::inverse_pose::InversePose>()
        .node::<arm::compose_poses::ComposePoses>()
        .node::<arm::ik_sink::IkSink>()
        .group("flow: flags, gates, switches, delays, test signals and printed values")
        .node::<flow::contact_debounce::ContactDebounce>()
        .node::<flow::compare::Compare>()
        .node::<flow::logic::All>()
        .node::<flow::logic::Any>()
        .node::<flow::logic::Not>()
        .node::<flow::gate::Gate<Scalar>>()
        .node::<flow::gate::Gate<Twist>>()
        .node::<flow::switch::Switch<Scalar>>()
        .node::<flow::switch::Switch<Twist>>()
        .node::<flow::delay::Delay<Scalar>>()
        .node::<flow::delay::Delay<Twist>>()
        .node::<flow::signal_generator::SignalGenerator>()
        .node::<flow::multisine::Multisine>()
        .node::<flow::probe::Probe>()
}
