//! The finger press as a graph and fused by hand, side by side.

use std::path::Path;

use tactflow_nodes::recordings::{self, Hints, Recording};
use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::Joints;
use tactflow_tests::{catalogue, workspace};

use crate::fused::Fused;

/// The graph on its bench, and the same by hand.
pub(crate) struct Pair {
    pub(crate) engine: Engine,
    pub(crate) fused: Fused,
    movie: Recording,
    /// Frames that both have seen.
    seen: usize,
    /// When contact and axis were there last [ticks].
    contact: Option<usize>,
    axis: Option<usize>,
}

fn read(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn joints(engine: &Engine, name: &str) -> [f64; 7] {
    let (_, id) = engine.ports().iter().find(|(port, _)| port.name == name).expect("the graph has that port");
    engine.bus().slot::<Joints>(*id).0[..].try_into().expect("seven joints")
}

impl Pair {
    pub(crate) fn new() -> Self {
        Self::of(Request::file(workspace().join("graphs/finger_press.toml")))
    }

    /// With a graph whose commands are next to nothing: the bench repeats a tick with an arm that stands, and joints that
    /// do not follow are a fault. The tick computes the same as ever, with other numbers.
    pub(crate) fn resting() -> Self {
        let gains = ["x", "y", "pressure", "orientation"].map(|feature| format!("nodes.pid.gains.{feature}.kp=1e-9"));
        let others = ["nodes.pid.gains.pressure.ki=1e-9", "nodes.guide.twist=[0, 1e-9, 0, 0, 0, 0]"].map(String::from);
        let request = Request::file(workspace().join("graphs/finger_press.toml"));
        Self::of(gains.into_iter().chain(others).fold(request, Request::set))
    }

    fn of(request: Request) -> Self {
        let graphs = workspace().join("graphs");
        let plan = compile(&catalogue(), &request);
        let engine = Engine::new(plan.unwrap_or_else(|report| panic!("{}", report.render(false))));
        let file = read(&graphs.join("recordings/pressuRe/iscan_test.csv"));
        let movie = recordings::read(&file, "iscan_test.csv", &Hints::default()).expect("the recording is sound");
        let fused = Fused::new(movie.shape.clone(), &movie.dead, &graphs.join("robots/lwr4p.urdf"));
        Self { engine, fused, movie, seen: 0, contact: None, axis: None }
    }

    /// The cells of a frame.
    pub(crate) fn cells(&self, frame: usize) -> &[f32] {
        let tactels = self.movie.shape.tactels();
        &self.movie.cells[frame * tactels..][..tactels]
    }

    /// Runs both on the next frame; whether their joint velocities have the same bits.
    pub(crate) fn step(&mut self) -> bool {
        let now = self.engine.next().expect("frames are left");
        self.engine.tick(now).expect("the recording is sound");
        let arm = ["arm.position", "arm.equilibrium"].map(|port| joints(&self.engine, port));
        let wanted = joints(&self.engine, "move.joints.velocity");
        let time = |frame: usize| self.movie.frames[frame].time;
        // As in the graph: a feature that is away for a tick of this slow recording is away for good.
        let is_gone = |last: Option<usize>| last.is_some_and(|last| last + 1 < self.seen);
        let (contact_gone, axis_gone) = (is_gone(self.contact), is_gone(self.axis));
        if contact_gone {
            self.fused.reset();
        } else if axis_gone {
            self.fused.reset_axes();
        }
        let dt = match self.contact.filter(|_| !contact_gone) {
            Some(last) => (time(self.seen) - time(last)) as f64 * 1e-9,
            None => 0.0,
        };
        let tick = if self.seen == 0 { 0.0 } else { (time(self.seen) - time(self.seen - 1)) as f64 * 1e-9 };
        let mut out = [0.0; 7];
        let tactels = self.movie.shape.tactels();
        let cells = &self.movie.cells[self.seen * tactels..][..tactels];
        let (has_contact, has_axis) = self.fused.tick(cells, [&arm[0], &arm[1]], dt, tick, &mut out);
        self.contact = if has_contact { Some(self.seen) } else { self.contact };
        self.axis = if has_axis { Some(self.seen) } else { self.axis };
        self.seen += 1;
        out.map(f64::to_bits) == wanted.map(f64::to_bits)
    }

    /// Frames of the recording.
    pub(crate) fn frames(&self) -> usize {
        self.movie.frames.len()
    }

    /// The arm's joints and their equilibrium as the last tick saw them.
    pub(crate) fn arm(&self) -> [[f64; 7]; 2] {
        ["arm.position", "arm.equilibrium"].map(|port| joints(&self.engine, port))
    }
}
