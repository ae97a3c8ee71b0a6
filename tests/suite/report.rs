//! `report`: a recorded run and the results of scenarios on one page, which loads nothing.

use std::fs;

use crate::cli::in_new_folder;
use crate::tool::{peer, say};

/// Writes the page of files into a folder. Returns the exit code, what the peer reads, and the page.
fn page_of(files: &[&str]) -> (i32, String, String) {
    let (_folder, path) = in_new_folder("page.html");
    let said = say(&[&["report"], files].concat());
    fs::write(&path, &said.out).unwrap();
    (said.code, peer("page.py", &[&path]), said.out)
}

#[test]
fn a_run_has_its_summary_its_curves_its_graph_and_its_modes() {
    let (_folder, run) = in_new_folder("run.mcap");
    let svg = run.replace("mcap", "svg");
    let said = say(&["run", "graphs/hybrid.toml", "--for", "3s", "--record", &run, "--svg", &svg]);
    assert_eq!(said.code, 0, "{}", said.err);
    let (code, read, page) = page_of(&[&run]);
    assert_eq!(code, 0);
    assert!(read.starts_with("1 3 0\n"), "one heading, three pictures, no table: {read}");
    let about = read.lines().find(|line| line.contains("graphs/hybrid.toml")).expect("what ran");
    assert!(about.contains("751 ticks in 3.000 s of virtual time; the time limit is reached"), "{about}");
    // The same curves as those of the run itself.
    let own = fs::read_to_string(&svg).unwrap();
    let curves = |text: &str| -> Vec<String> {
        text.lines().filter(|line| line.starts_with("<polyline") && line.len() > 500).map(str::to_owned).collect()
    };
    let own = curves(&own);
    assert!(own.len() >= 3 && own.iter().all(|curve| page.contains(curve.as_str())), "{} curves", own.len());
    for text in [">sensor_pose: pose in pad in arm.base<", ">touch.present is lost for 100 ms<", "servo     1.116 s"] {
        assert!(page.contains(text), "{text}");
    }
}

#[test]
fn a_run_in_real_time_has_the_lateness_of_its_ticks() {
    let (_folder, run) = in_new_folder("run.mcap");
    let said = say(&["run", "graphs/hybrid.toml", "--for", "1s", "--realtime", "--record", &run]);
    assert_eq!(said.code, 0, "{}", said.err);
    let (code, read, page) = page_of(&[&run]);
    assert_eq!(code, 0);
    assert!(read.starts_with("1 4 0\n") && page.contains("class=\"bars\""), "one picture more: {read}");
    // The same ticks as the run itself has counted.
    let table = |text: &str| -> Vec<String> {
        let lines = text.lines().skip_while(|line| !line.starts_with("ticks began late by"));
        let lines = lines.take_while(|line| !line.starts_with("latest tick"));
        lines.map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
    };
    let own = table(&said.out);
    assert!(own.len() >= 2 && table(&page) == own, "{own:?} {:?}", table(&page));
    let latest = said.out.lines().find(|line| line.starts_with("latest tick: ")).expect("no clock is exact");
    let latest = latest.split(';').next().unwrap();
    assert!(page.contains(latest), "{latest}");
}

#[test]
fn a_scenario_stands_beside_the_paper_and_its_failure_is_the_exit_code() {
    let (code, read, page) = page_of(&["tests/scenarios/slide.toml", "tests/scenarios/missed.toml"]);
    assert_eq!(code, 1);
    let words: Vec<&str> = read.lines().collect();
    for word in ["median of runs", "paper", "slide", "missed", "passed", "FAILED"] {
        assert!(words.contains(&word), "{word}: {read}");
    }
    assert!(page.contains("<tr class=\"failed\">"));
    let nothing = say(&["report", "nowhere.mcap"]);
    assert_eq!(nothing.code, 2);
    assert!(nothing.err.contains("nowhere.mcap") && nothing.out.is_empty(), "{}", nothing.err);
}

/// The page in a browser, as a picture.
#[test]
#[ignore = "it needs Chromium: `.ci/edge` installs it and runs it"]
fn a_browser_shows_the_page() {
    let (_folder, run) = in_new_folder("run.mcap");
    assert_eq!(say(&["run", "graphs/hybrid.toml", "--for", "3s", "--quiet", "--record", &run]).code, 0);
    let html = run.replace("mcap", "html");
    fs::write(&html, say(&["report", &run]).out).unwrap();
    let picture = run.replace("mcap", "png");
    let browser = std::process::Command::new("chromium")
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--window-size=1200,3000"])
        .args([format!("--screenshot={picture}"), format!("file://{html}")])
        .output()
        .expect("Chromium is installed");
    assert!(browser.status.success(), "{}", String::from_utf8_lossy(&browser.stderr));
    // Zlib packs an empty page of this size to less than 20 kB.
    let size = fs::metadata(&picture).unwrap().len();
    assert!(size > 100_000, "the picture has {size} bytes");
}
