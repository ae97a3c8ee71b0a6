//! What a task tells a device without moving it.

use tactflow_nodes::catalogue;
use tactflow_runtime::engine::{self, Engine, RunOptions};
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::Pose;
use tactflow_tests::workspace;

fn engine(graph: &str) -> Engine {
    let request =
        Request::file(workspace().join("graphs").join(graph)).bench(workspace().join("graphs/benches/mock.toml"));
    Engine::new(compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false))))
}

#[test]
fn a_device_is_told_what_the_wire_brings_while_it_is_there_and_also_while_commands_are_held() {
    let mut engine = engine("hybrid.toml");
    let (mut told, mut silent, mut held) = (0, 0, 0);
    while let Some(now) = engine.next() {
        if engine.ticks() == 300 {
            engine.send("stop").unwrap();
        }
        engine.tick(now).unwrap();
        let expected = engine.get::<Pose>("ruler.point.pose");
        assert_eq!(engine.report::<Pose>("arm.contact"), expected, "tick {}", engine.ticks());
        told += u32::from(expected.is_some());
        silent += u32::from(expected.is_none());
        held += u32::from(expected.is_some() && engine.is_halted());
    }
    assert!(told > 300 && silent > 100 && held > 300, "{told} {silent} {held}");
    assert_eq!(engine.report::<Pose>("arm.nothing"), None, "there is no such report");
}

#[test]
fn after_the_last_tick_nothing_is_reported_any_more() {
    let mut engine = engine("hybrid.toml");
    let options = RunOptions { duration: Some(1.0), ..RunOptions::default() };
    let mut was_told = false;
    engine::run(&mut engine, &options, &mut |engine| was_told = engine.report::<Pose>("arm.contact").is_some())
        .unwrap();
    assert!(was_told && engine.report::<Pose>("arm.contact").is_none());
}
