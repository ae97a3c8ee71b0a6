//! The picture of the modes of a graph, and of what leads from one to another.

use std::collections::HashMap;

use serde_json::Value;

use super::picture::{Arrow, Look, Picture};
use crate::graph::Outline;

/// Keys of a mode that end it.
const EXITS: [&str; 4] = ["go", "on_lost", "done", "fail"];

/// Returns the picture of all modes. Those of a part that is a task are in its frame.
pub(super) fn picture(outline: &Outline, title: String) -> Picture {
    let mut picture = Picture::new(title);
    let mut boxes = HashMap::new();
    for mode in &outline.modes {
        let (task, name) = mode.name.rsplit_once('.').unwrap_or(("", &mode.name));
        let group = picture.group(task);
        boxes.insert((task, name), picture.add(vec![name.to_owned()], Look::Inner, group));
    }
    let mut ends = HashMap::new();
    let mut end = |picture: &mut Picture, task: &str, word: &'static str| {
        let group = picture.group(task);
        *ends.entry((group, word)).or_insert_with(|| picture.add(vec![word.to_owned()], Look::Outer, group))
    };
    for (task, start) in starts(outline) {
        let Some(to) = boxes.get(&(task, &*start)).copied() else { continue };
        let from = end(&mut picture, task, "start");
        picture.arrows.push(Arrow { from, to, lines: Vec::new(), is_dashed: false });
    }
    for mode in &outline.modes {
        let (task, name) = mode.name.rsplit_once('.').unwrap_or(("", &mode.name));
        let Some(from) = boxes.get(&(task, name)).copied() else { continue };
        for (key, exit) in mode.settings.iter().filter(|setting| EXITS.contains(&&*setting.path)).flat_map(exits) {
            let to = match key {
                "done" => Some(end(&mut picture, task, "done")),
                "fail" => Some(end(&mut picture, task, "fault")),
                _ => exit["to"].as_str().and_then(|to| boxes.get(&(task, to))).copied(),
            };
            let Some(to) = to else { continue };
            let is_dashed = matches!(key, "on_lost" | "fail");
            picture.arrows.push(Arrow { from, to, lines: condition(key, &exit), is_dashed });
        }
    }
    picture
}

/// Returns the first mode of the graph and of each task.
fn starts(outline: &Outline) -> Vec<(&str, String)> {
    let all =
        [("", &outline.settings)].into_iter().chain(outline.tasks.iter().map(|task| (&*task.name, &task.settings)));
    let start = |(task, settings): (_, &Vec<crate::graph::Setting>)| {
        let start = settings.iter().find(|setting| setting.path == "start")?;
        Some((task, serde_json::to_value(&start.value).ok()?.as_str()?.to_owned()))
    };
    all.filter_map(start).collect()
}

/// Returns the exits of a setting, each with its key: one, or a list of them.
fn exits(setting: &crate::graph::Setting) -> Vec<(&str, Value)> {
    let value = serde_json::to_value(&setting.value).unwrap_or_default();
    let all = if let Value::Array(all) = value { all } else { vec![value] };
    all.into_iter().map(|exit| (&*setting.path, exit)).collect()
}

/// Returns the condition of an exit, in words.
fn condition(key: &str, exit: &Value) -> Vec<String> {
    let text = |key: &str| exit[key].as_str().map(str::to_owned);
    let number = |key: &str| exit[key].as_f64();
    if key == "on_lost" {
        let lasts = number("after_ms").map_or_else(String::new, |ms| format!(" for {}", time(ms)));
        return vec![format!("{} is lost{lasts}", text("of").unwrap_or_default())];
    }
    let mut lines = Vec::new();
    if let Some(when) = text("when") {
        let is = text("is").map(|is| format!(" is {is}"));
        let bounds = ["above", "below", "within"];
        let bounds = bounds.iter().filter_map(|bound| Some(format!(" {bound} {}", number(bound)?)));
        lines.push(when + &is.into_iter().chain(bounds).collect::<String>());
        lines.extend(number("for_ms").map(|ms| format!("for {}", time(ms))));
    }
    lines.extend(text("on").map(|word| format!("on the word {word}")));
    lines.extend(number("after_ms").map(|ms| format!("after {}", time(ms))));
    lines.extend(number("after_travel_mm").map(|mm| format!("after {mm} mm of travel")));
    lines
}

fn time(ms: f64) -> String {
    if ms >= 1000.0 { format!("{} s", ms / 1000.0) } else { format!("{ms} ms") }
}
