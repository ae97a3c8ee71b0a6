//! Each fault on the frames of a device whose values are known.

use super::commands::SpoiltCommand;
use super::device::Spoilt;
use super::fault::Fault;
use super::resolve::{Injection, Target};
use super::table::{InjectBlock, blocks};
use crate::device::{Commands, Description, DeviceError, Disturbance, Output, Samples, Stepped};
use crate::node::Reader;
use crate::random::Random;
use crate::signal::{Image, ImageShape, Unit, VectorImage, VectorImageShape};
use crate::source::{SourceMap, parse_table};

const FRAMES: u64 = 1000;
const SHAPE: ImageShape = ImageShape { rows: 2, cols: 3, pitch: [0.005; 2], unit: Unit::RAW };

/// A device with a frame every millisecond: cell i of frame k reads 1000 (i + 1) + k.
struct Ramp;

impl Stepped for Ramp {
    fn next(&self) -> Option<i64> {
        Some(0)
    }

    fn exchange(&mut self, now: i64, _: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        let frame = now / 1_000_000;
        let image = samples.write(Output::<Image>::at(0), now, frame as u64 + 1);
        image.cells_mut().copy_from_slice(&good(frame as u64));
        Ok(())
    }
}

fn good(frame: u64) -> Vec<f32> {
    (0..6).map(|i| (1000 * (i + 1) + frame) as f32).collect()
}

fn entries(text: &str) -> (Vec<InjectBlock>, Vec<String>) {
    let mut sources = SourceMap::default();
    let root = parse_table(sources.add("scenario.toml", text, "")).expect("the test's own text");
    let mut reader = Reader::new(&sources);
    let blocks = blocks(root.as_table().expect("a file is a table"), &mut reader);
    (blocks, reader.mistakes.into_iter().map(|mistake| mistake.message).collect())
}

/// A frame that arrives: the tick, its stamp, its number and its values.
type Arrived = (u64, i64, u64, Vec<f32>);

/// Runs a device with faults. Returns the frames that arrive, and how many faults have hit one.
fn run(text: &str, seed: u64) -> (Vec<Arrived>, u64) {
    let (blocks, mistakes) = entries(text);
    assert_eq!(mistakes, [""; 0], "{text}");
    let injection = |block: InjectBlock| {
        let table = block.table.expect("no mistake");
        Injection { device: 0, target: Target::Image(0, None, SHAPE), table }
    };
    let injections: Vec<Injection> = blocks.into_iter().map(injection).collect();
    let numbered: Vec<(usize, &Injection)> = injections.iter().enumerate().collect();
    let mut description = Description::every(0.001);
    description.fills("pad").output::<Image>("image", SHAPE);
    let (mut samples, commands) = (Samples::of(&description), Commands::of(&description));
    let mut device = Spoilt::new(Box::new(Ramp), Samples::of(&description), &numbered, seed);
    let (mut arrived, mut writes) = (Vec::new(), 0);
    for frame in 0..FRAMES {
        device.exchange(frame as i64 * 1_000_000, &commands, &mut samples).expect("the device does not fail");
        let sample = &samples.ports[0];
        if std::mem::replace(&mut writes, sample.writes) != sample.writes {
            let image = samples.get(Output::<Image>::at(0)).expect("a frame was written");
            arrived.push((frame, sample.stamp, sample.sequence, image.cells().to_vec()));
        }
    }
    assert_eq!(samples.counts.len(), 1);
    (arrived, samples.counts[0].1)
}

fn entry(rest: &str) -> String {
    format!("[[inject]]\nrole = \"pad\"\n{rest}\n")
}

#[test]
fn faults_of_cells_change_these_cells_at_these_times_and_nothing_else() {
    // The fault, and the value of a cell that reads `x` in frame `k` if the fault hits it.
    type Change = fn(f32, u64) -> f32;
    let cases: [(&str, &[usize], Change); 6] = [
        ("fault = \"dead\"\ncells = [[0, 1], [1, 2]]", &[1, 5], |_, _| 0.0),
        ("fault = \"stuck\"\ncells = [[1, 0]]\nreading = 4095", &[3], |_, _| 4095.0),
        ("fault = \"spike\"\ncells = [[0, 0]]\nreading = 7.5\nrate = 1.0", &[0], |_, _| 7.5),
        ("fault = \"gain\"\ncells = [[0, 0]]\nfactor = 0.5", &[0], |x, _| 0.5 * x),
        ("fault = \"gain\"\nfactor = 2", &[0, 1, 2, 3, 4, 5], |x, _| 2.0 * x),
        ("fault = \"drift\"\ncells = [[1, 1]]\nreading_per_s = -2000", &[4], |x, k| x - 2.0 * (k as f32 - 100.0)),
    ];
    for (text, cells, change) in cases {
        let (arrived, hits) = run(&entry(&format!("{text}\nfrom_s = 0.1\nto_s = 0.2")), 1);
        assert_eq!((arrived.len() as u64, hits), (FRAMES, 100), "{text}");
        for (frame, stamp, sequence, values) in arrived {
            let mut wanted = good(frame);
            if (100..200).contains(&frame) {
                cells.iter().for_each(|cell| wanted[*cell] = change(wanted[*cell], frame));
            }
            assert_eq!((values, stamp, sequence), (wanted, frame as i64 * 1_000_000, frame + 1), "{text}");
        }
    }
}

#[test]
fn a_fault_of_frames_hits_the_first_ones_or_a_fraction_of_all() {
    let counted = |fault: &str| run(&entry(&format!("fault = \"{fault}\"\nframes = 3\nfrom_s = 0.1")), 1);
    let (arrived, hits) = counted("missing");
    let missing: Vec<u64> = (0..FRAMES).filter(|k| !arrived.iter().any(|(frame, ..)| frame == k)).collect();
    assert_eq!((missing, hits), (vec![100, 101, 102], 3));
    let (arrived, _) = counted("repeat");
    assert_eq!(arrived.len() as u64, FRAMES);
    for (frame, stamp, sequence, values) in arrived {
        // Bit for bit the frame before, and a stamp and a number of its own.
        let wanted = if (100..103).contains(&frame) { good(99) } else { good(frame) };
        assert_eq!((values, stamp, sequence), (wanted, frame as i64 * 1_000_000, frame + 1));
    }
    // Three standard deviations of the binomial distribution around 100 of 1000.
    let (arrived, hits) = run(&entry("fault = \"missing\"\nrate = 0.1"), 5);
    assert_eq!(arrived.len() as u64 + hits, FRAMES);
    assert!(hits.abs_diff(100) <= 28, "{hits}");
    let frames =
        |seed| run(&entry("fault = \"missing\"\nrate = 0.1"), seed).0.iter().map(|one| one.0).collect::<Vec<_>>();
    assert_eq!(frames(5), frames(5));
    assert_ne!(frames(5), frames(6));
}

#[test]
fn garbage_and_nan_are_what_they_are_called() {
    let (arrived, _) = run(&entry("fault = \"garbage\"\nreading = 50\nframes = 1\nfrom_s = 0.1"), 1);
    let garbage = &arrived[100].3;
    assert!(garbage.iter().all(|value| (0.0..50.0).contains(value)), "{garbage:?}");
    assert!((1..6).any(|i| garbage[i].to_bits() != garbage[0].to_bits()));
    assert_eq!(arrived[101].3, good(101));
    let (arrived, _) = run(&entry("fault = \"nan\"\ncells = [[1, 2]]\nframes = 1\nfrom_s = 0.1"), 1);
    let nan = arrived.iter().filter(|(.., values)| values.iter().any(|value| value.is_nan()));
    assert_eq!(nan.map(|(frame, .., values)| (*frame, values[5].is_nan())).collect::<Vec<_>>(), [(100, true)]);
}

#[test]
fn delayed_frames_arrive_late_with_their_own_stamps_and_never_go_back() {
    let (arrived, _) = run(&entry("fault = \"late\"\ndelay_ms = 4.0\nfrom_s = 0.1\nto_s = 0.2"), 1);
    for (tick, stamp, sequence, values) in &arrived {
        let frame = sequence - 1;
        assert_eq!((*stamp, values), (frame as i64 * 1_000_000, &good(frame)));
        assert_eq!(*tick, if (100..200).contains(&frame) { frame + 4 } else { frame });
    }
    // Frame 200 is on time, and overtakes the last frames that are late.
    let numbers: Vec<u64> = arrived.iter().map(|(_, _, sequence, _)| sequence - 1).collect();
    assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]));
    assert_eq!(numbers, (0..196).chain(200..FRAMES).collect::<Vec<_>>());
}

#[test]
fn jitter_delays_each_frame_by_its_own_time_and_none_goes_back() {
    let (arrived, hits) = run(&entry("fault = \"jitter\"\ndelay_ms = 5.0"), 1);
    assert_eq!(hits, FRAMES);
    let delays: Vec<u64> = arrived.iter().map(|(tick, _, sequence, _)| tick + 1 - sequence).collect();
    // A time between 0 and 5 ms ends in one of the next five ticks.
    assert!((1..=5).all(|delay| delays.contains(&delay)) && delays.iter().all(|delay| (1..=5).contains(delay)));
    assert!(arrived.windows(2).all(|pair| pair[0].2 < pair[1].2));
    assert!(arrived.iter().all(|(_, stamp, sequence, _)| *stamp == (*sequence as i64 - 1) * 1_000_000));
}

#[test]
fn swapped_cells_read_what_the_next_one_reads() {
    let (arrived, _) = run(&entry("fault = \"swapped\"\ncells = [[0, 1], [1, 0], [1, 2]]"), 1);
    for (frame, .., values) in arrived {
        let good = good(frame);
        assert_eq!(values, [good[0], good[3], good[2], good[5], good[4], good[1]]);
    }
}

/// Sends 1, 2, 3, … to both joints of a device each millisecond, with a fault. Returns what arrives at each.
fn sent(rest: &str) -> Vec<[f64; 2]> {
    let (blocks, mistakes) = entries(&entry(rest));
    assert_eq!(mistakes, [""; 0]);
    let table = blocks[0].table.as_ref().expect("no mistake");
    let mut command = SpoiltCommand::new(0);
    command.faults.push(Fault::new(table, vec![1], Random::new(1, 0)));
    let mut values = [0.0; 2];
    let each = |tick: i64| {
        command.deliver(tick * 1_000_000, &[tick as f64 + 1.0; 2], &mut values);
        values
    };
    (0..10).map(each).collect()
}

#[test]
fn commands_are_lost_late_or_stopped() {
    let both = |values: [i32; 10]| values.map(|value| [f64::from(value); 2]);
    assert_eq!(sent("fault = \"lost\"\nframes = 3\nfrom_s = 0.002"), both([1, 2, 2, 2, 2, 6, 7, 8, 9, 10]));
    assert_eq!(sent("fault = \"lag\"\ndelay_ms = 3"), both([0, 0, 0, 1, 2, 3, 4, 5, 6, 7]));
    // What is on its way when the lag ends is overtaken.
    let ends = "fault = \"lag\"\ndelay_ms = 3\nto_s = 0.006";
    assert_eq!(sent(ends), both([0, 0, 0, 1, 2, 3, 7, 8, 9, 10]));
    let stops = sent("fault = \"joint_stop\"\njoints = [\"b\"]\nfrom_s = 0.002\nto_s = 0.004");
    assert_eq!(
        stops,
        [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]
            .map(|tick| [f64::from(tick), if tick == 3 || tick == 4 { 0.0 } else { f64::from(tick) }])
    );
}

#[test]
fn the_world_is_disturbed_while_the_fault_is_there() {
    let text = [
        "fault = \"push\"\npush_n = [1, 2, 3]\nfrom_s = 0.1",
        "fault = \"push\"\npush_n = [0, 0, 4]\nfrom_s = 0.2",
        "fault = \"moving\"\nvelocity_m_per_s = [0, 0, 0.5]\nto_s = 0.2",
        "fault = \"stiff\"\nfactor = 3\nfrom_s = 0.1\nto_s = 0.2",
        "fault = \"gone\"\nfrom_s = 0.2",
    ];
    let (blocks, mistakes) = entries(&text.map(entry).concat());
    assert_eq!(mistakes, [""; 0]);
    let tables = blocks.iter().filter_map(|block| block.table.as_ref());
    let faults: Vec<Fault> = tables.map(|table| Fault::new(table, vec![], Random::new(1, 0))).collect();
    let at = |now: i64| {
        let mut world = Disturbance::default();
        faults.iter().for_each(|fault| fault.disturb(now, &mut world));
        world
    };
    let velocity = [0.0, 0.0, 0.5];
    assert_eq!(at(0), Disturbance { velocity, ..Disturbance::default() });
    let push = [1.0, 2.0, 3.0];
    assert_eq!(at(100_000_000), Disturbance { push, velocity, stiffness: 3.0, is_gone: false });
    let push = [1.0, 2.0, 7.0];
    assert_eq!(at(200_000_000), Disturbance { push, is_gone: true, ..Disturbance::default() });
}

#[test]
fn two_faults_of_a_role_add_up() {
    let dead = entry("fault = \"dead\"\ncells = 2");
    let text = format!("{dead}{}", entry("fault = \"stuck\"\ncells = 1\nreading = 1"));
    for seed in 0..50 {
        let (arrived, hits) = run(&text, seed);
        let values = &arrived[0].3;
        let count = |wanted: f32| values.iter().filter(|value| **value == wanted).count();
        assert_eq!((count(0.0), count(1.0), hits), (2, 1, 2 * FRAMES), "seed {seed}: {values:?}");
    }
}

#[test]
fn each_mistake_in_the_keys_of_a_fault_is_reported_once() {
    let cases = [
        ("fault = \"stuck\"\ncells = 1", "the fault `stuck` needs `reading`"),
        ("fault = \"dead\"", "the fault `dead` needs `cells`"),
        ("fault = \"repeat\"", "the fault `repeat` needs `rate` or `frames`"),
        ("fault = \"repeat\"\nrate = 0.1\nframes = 1", "a fault has either `rate` or `frames`"),
        ("fault = \"missing\"\nrate = 0.1\ncells = 1", "the fault `missing` has no `cells`"),
        ("fault = \"swapped\"\ncells = 1", "one cell has no other one to exchange its readings with"),
        ("fault = \"joint_stop\"", "the fault `joint_stop` needs `joints`"),
        ("fault = \"lost\"", "the fault `lost` needs `rate` or `frames`"),
        ("fault = \"gone\"\nfactor = 2", "the fault `gone` has no `factor`"),
        ("fault = \"dead\"\ncells = 1\nfrom_s = 2\nto_s = 1", "the fault ends at 1 s, before it begins at 2 s"),
        ("fault = \"dead\"\ncells = 1\nfrom_s = 9", "the run ends after 5 s, before the fault begins at 9 s"),
    ];
    for (text, message) in cases {
        let (blocks, mistakes) = entries(&entry(text));
        assert_eq!(mistakes, [""; 0]);
        let found = blocks[0].mistake(Some(5.0)).map(|diagnostic| (diagnostic.message, diagnostic.help.is_some()));
        assert_eq!(found, Some((message.to_owned(), true)));
    }
    for (text, message) in [
        ("fault = \"dead\"\ncells = 0", "expected a number of cells, or a list of `[row, column]`, found 0"),
        ("fault = \"dead\"\ncells = []", "expected a number of cells, or a list of `[row, column]`, found a list of 0"),
    ] {
        assert_eq!(entries(&entry(text)).1, [message]);
    }
}

/// The ramp of a pad with three axes: x is the reading, y twice as much, and z the reading again.
struct ThreeAxes;

impl Stepped for ThreeAxes {
    fn next(&self) -> Option<i64> {
        None
    }

    fn exchange(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        Ramp.exchange(now, commands, samples)?;
        let frame = now as u64 / 1_000_000;
        let vectors = good(frame).into_iter().map(|value| [value, 2.0 * value, value]).collect::<Vec<_>>();
        samples.write(Output::<VectorImage>::at(1), now, frame + 1).cells_mut().copy_from_slice(&vectors);
        Ok(())
    }
}

#[test]
fn what_hits_a_frame_hits_both_of_its_images() {
    let faults = [
        "fault = \"dead\"\ncells = [[0, 1]]",
        "fault = \"gain\"\nfactor = 2",
        "fault = \"spike\"\ncells = [[0, 0]]\nreading = 7.5\nrate = 0.3",
        "fault = \"swapped\"\ncells = [[0, 0], [1, 2]]",
        "fault = \"missing\"\nrate = 0.3",
        "fault = \"repeat\"\nrate = 0.3",
        "fault = \"garbage\"\nreading = 50\nrate = 0.3",
        "fault = \"late\"\ndelay_ms = 3",
        "fault = \"jitter\"\ndelay_ms = 3",
    ];
    for text in faults {
        let (blocks, mistakes) = entries(&entry(text));
        assert_eq!(mistakes, [""; 0], "{text}");
        let table = blocks.into_iter().next().and_then(|block| block.table).expect("no mistake");
        let injection = Injection { device: 0, target: Target::Image(0, Some(1), SHAPE), table };
        let mut description = Description::every(0.001);
        let mut pad = description.fills("pad");
        pad.output::<Image>("image", SHAPE);
        pad.output::<VectorImage>("vectors", VectorImageShape(SHAPE));
        let (mut samples, commands) = (Samples::of(&description), Commands::of(&description));
        let mut device = Spoilt::new(Box::new(ThreeAxes), Samples::of(&description), &[(0, &injection)], 3);
        let mut is_spoilt = false;
        for frame in 0..FRAMES {
            device.exchange(frame as i64 * 1_000_000, &commands, &mut samples).expect("the device does not fail");
            let [image, vectors] = [0, 1].map(|port| (samples.ports[port].stamp, samples.ports[port].writes));
            assert_eq!(image, vectors, "{text}: frame {frame}");
            let Some(image) = samples.get(Output::<Image>::at(0)) else { continue };
            let vectors = samples.get(Output::<VectorImage>::at(1)).expect("both are written");
            let normal: Vec<f32> = vectors.cells().iter().map(|[.., z]| *z).collect();
            assert_eq!(image.cells(), normal, "{text}: frame {frame}");
            is_spoilt |= image.cells() != good(frame);
        }
        assert!(is_spoilt, "{text}");
    }
}
