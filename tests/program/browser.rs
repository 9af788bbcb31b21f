//! The HTML report of `demhybrid analyze` in a real browser: chromium, named by CHROMIUM, by
//! launch/test-long.sh.

use crate::mpirun::{Job, PACKAGE};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// What chromium does with `page`: what it printed, and what it complained of.
fn browse(folder: &Path, page: &Path, more: &[&str]) -> (String, String) {
    let chromium = std::env::var("CHROMIUM").expect("CHROMIUM is not set");
    let profile = format!("--user-data-dir={}", folder.join("profile").display());
    let log = format!("--log-net-log={}", folder.join("net.json").display());
    let url = format!("file://{}", page.display());
    let always = ["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--no-first-run"];
    let arguments = [&always[..], &[&profile, &log], more, &[&url]].concat();
    let ended = Job::alone(folder, &arguments).of(chromium.into()).run().with_code(0);
    (ended.stdout, ended.stderr)
}

/// Hosts that the page asked for, by the browser's log of the network; the browser's own questions to its
/// maker apart.
fn asked_for(folder: &Path) -> Vec<String> {
    let log = fs::read_to_string(folder.join("net.json")).unwrap();
    assert!(log.contains("\"constants\""), "no log of the network");
    let mut hosts: Vec<String> = log
        .split("\"url\":\"http")
        .skip(1)
        .filter_map(|rest| rest.split("://").nth(1)?.split(['/', '"', ':', '?']).next().map(str::to_owned))
        .filter(|host| {
            !["google.com", "googleapis.com", "gvt1.com"].iter().any(|maker| host.ends_with(maker))
        })
        .collect();
    hosts.sort();
    hosts.dedup();
    hosts
}

/// Messages of the page: errors of scripts, styles and resources.
fn of_console(stderr: &str) -> Vec<&str> {
    stderr.lines().filter(|line| line.contains(":CONSOLE")).collect()
}

#[test]
fn the_report_opens_in_a_browser_without_errors_and_without_a_network() {
    let folder = TempDir::new().unwrap();
    let scene = format!("{PACKAGE}/configs/quick.toml");
    Job::alone(folder.path(), &[&scene, "-q"]).run().with_code(0);
    Job::alone(folder.path(), &["analyze", "quick.vtkhdf", "--frame", "all"]).run().with_code(0);
    let page = folder.path().join("quick-analysis/report.html");

    let (dom, complaints) = browse(folder.path(), &page, &["--dump-dom"]);
    assert_eq!(of_console(&complaints), [""; 0], "{complaints}");
    // The browser's own tree of the page: every figure is drawn, with lines in it, and nothing is left
    // unclosed.
    let drawn: Vec<&str> = dom.split("<figure").skip(1).collect();
    assert!(drawn.len() >= 10, "{} figures", drawn.len());
    for figure in &drawn {
        let inside = figure.split("</figure>").next().unwrap();
        assert!(inside.contains("<svg") && inside.contains("<polyline"), "{inside:.300}");
    }
    assert!(
        dom.contains("aria-label=\"the bed from the front\"") && dom.contains("volume fraction of the union")
    );
    assert!(dom.trim_end().ends_with("</html>"), "{}", &dom[dom.len().saturating_sub(200)..]);
    // Nothing is fetched but the page itself: no element names a resource.
    for attribute in [" src=", " href=", "url(http", "@import", "<script", "<link", "<iframe"] {
        assert!(!dom.contains(attribute), "{attribute} in the page");
    }
    assert_eq!(asked_for(folder.path()), [""; 0]);

    browse(folder.path(), &page, &["--hide-scrollbars", "--window-size=1280,3600", "--screenshot=shot.png"]);
    let shot = fs::File::open(folder.path().join("shot.png")).unwrap();
    let mut reader = png::Decoder::new(std::io::BufReader::new(shot)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height), (1280, 3600));
    let samples = info.color_type.samples();
    let coloured = pixels.chunks(samples).filter(|p| p[..3].iter().any(|&c| c < 128)).count();
    // The spheres of the picture alone are 40 000 pixels and more; an empty page has none.
    assert!(coloured > 40_000, "{coloured} dark pixels");
}

#[test]
fn what_is_looked_for_is_seen_on_a_page_with_mistakes() {
    let folder = TempDir::new().unwrap();
    let page = folder.path().join("bad.html");
    fs::write(
        &page,
        "<!DOCTYPE html><html><body><script>throw new Error('seen')</script>\
         <img src='http://example.invalid/a.png'></body></html>",
    )
    .unwrap();
    let (_, complaints) = browse(folder.path(), &page, &["--dump-dom"]);
    assert!(of_console(&complaints).iter().any(|line| line.contains("seen")), "{complaints}");
    assert_eq!(asked_for(folder.path()), ["example.invalid"]);
}
