//! Tests of figures, from the SVG files that they write.

use super::*;
use crate::math::interval::{Interval, interval};
use std::path::Path;

fn point(label: &str, error: f64, rhs: f64, core_seconds: f64) -> Point {
    Point { label: label.to_owned(), error, rhs, core_seconds, failed: false }
}

fn curve(name: &str, points: Vec<Point>) -> Curve {
    Curve { name: name.to_owned(), points }
}

/// Draws a figure and checks that it is well-formed XML without NaN and infinity. Returns its texts.
fn words(draw: impl FnOnce(&Path)) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("figure.svg");
    draw(&path);
    let svg = std::fs::read_to_string(&path).unwrap();
    let document = roxmltree::Document::parse(&svg).unwrap();
    assert_eq!(document.root_element().tag_name().name(), "svg");
    for node in document.descendants().filter(|node| !node.is_text()) {
        for attribute in node.attributes() {
            let value = attribute.value();
            assert!(!value.contains("NaN") && !value.contains("inf"), "{attribute:?}");
        }
    }
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    texts.filter_map(|node| node.text()).map(|text| text.trim().to_owned()).collect()
}

fn holds(words: &[String], word: &str) -> bool {
    words.iter().any(|other| other == word)
}

#[test]
fn work_and_error_name_methods_tolerances_and_axes() {
    let curves = [
        curve("merson", vec![point("1e-1", 1e-2, 1e4, 0.1), point("1e-5", 1e-6, 1e6, 9.0)]),
        curve("chebyshev", vec![point("1e-2", 3e-3, 3e3, 0.03), point("1e-6", 1e-7, 2e5, 2.0)]),
    ];
    let words = words(|path| work_precision(path, "Impact", "error (m)", &curves).unwrap());
    for word in
        ["Impact", "error (m)", "right-hand sides", "core time (s)", "merson", "chebyshev", "1e-1", "1e-5"]
    {
        assert!(holds(&words, word), "{word}: {words:?}");
    }
    assert!(!holds(&words, "failed"));
}

#[test]
fn a_failed_run_is_shown_with_its_tolerance() {
    let failed = Point { failed: true, error: f64::NAN, ..point("0.77", 0.0, 5e3, 0.2) };
    let fine = vec![point("1e-2", 1e-3, 1e4, 0.1), point("1e-3", 1e-4, 2e4, 0.2)];
    let curves = [curve("auto", [vec![failed], fine].concat())];
    let words = words(|path| work_precision(path, "", "error", &curves).unwrap());
    assert!(holds(&words, "failed") && holds(&words, "0.77"), "{words:?}");
}

#[test]
fn an_error_of_zero_has_its_own_position() {
    let curves = [curve("merson", vec![point("1e-2", 1e-3, 10.0, 1.0), point("1e-9", 0.0, 90.0, 9.0)])];
    let words = words(|path| work_precision(path, "", "error", &curves).unwrap());
    assert!(holds(&words, "0"), "{words:?}");
}

#[test]
fn no_numbers_make_drawing_impossible() {
    let nasty = [0.0, -0.0, 1e-16, -1.0, 1.0, 5e-324, f64::MAX, f64::MIN, f64::NAN, f64::INFINITY];
    words(|path| work_precision(path, "", "", &[]).unwrap());
    words(|path| series(path, "", "", "", true, &[]).unwrap());
    words(|path| ensemble(path, "", &[]).unwrap());
    for a in nasty {
        for b in nasty {
            let points =
                vec![point("", a, b, b), point("", b, a, a), Point { failed: true, ..point("", a, b, a) }];
            words(|path| work_precision(path, "", "", &[curve("x", vec![]), curve("y", points)]).unwrap());
            let line = Line { name: "line".to_owned(), points: vec![(a, b), (b, a), (a, a)] };
            for log_y in [false, true] {
                words(|path| series(path, "", "", "", log_y, std::slice::from_ref(&line)).unwrap());
                for across in [Across::Logarithmic, Across::Linear, Across::Named(vec![])] {
                    let bar =
                        |x, mean, half_width| Bar { x, interval: Interval { mean, half_width, count: 1 } };
                    let groups = vec![Group { name: "g".to_owned(), bars: vec![bar(a, b, a), bar(b, a, b)] }];
                    let panel = Panel { name: String::new(), x_label: String::new(), across, log_y, groups };
                    words(|path| ensemble(path, "", &[panel]).unwrap());
                }
            }
        }
    }
}

#[test]
fn no_words_break_the_file() {
    let nasty = format!("<a href=\"x\">&amp;\u{1}\u{0}\n]]>{}", "ž".repeat(1000));
    let curves: Vec<Curve> = (0..50).map(|_| curve(&nasty, vec![point(&nasty, 1.0, 1.0, 1.0)])).collect();
    let words = words(|path| work_precision(path, &nasty, &nasty, &curves).unwrap());
    assert!(words.iter().any(|word| word.starts_with("<a href=\"x\">&amp;")), "{words:?}");
    assert!(holds(&words, "and 26 more"));
}

#[test]
fn an_ensemble_names_statistics_solvers_and_categories() {
    let bars = vec![Bar { x: 0.0, interval: interval(&[1.0, 2.0, 3.0]).unwrap() }];
    let panel = |name: &str, across| Panel {
        name: name.to_owned(),
        x_label: "tolerance".to_owned(),
        across,
        log_y: false,
        groups: vec![Group { name: "merson".to_owned(), bars: bars.clone() }],
    };
    let categories = vec!["1e-2".to_owned(), "1e-5 s".to_owned()];
    let panels = [panel("height (m)", Across::Named(categories)), panel("energy (J)", Across::Linear)];
    let words = words(|path| ensemble(path, "Statistics", &panels).unwrap());
    for word in ["Statistics", "height (m)", "energy (J)", "merson", "1e-2", "1e-5 s", "tolerance"] {
        assert!(holds(&words, word), "{word}: {words:?}");
    }
    assert_eq!(words.iter().filter(|&word| word == "merson").count(), 1);
}

#[test]
fn a_million_points_do_not_make_a_large_file() {
    let points = (0..1_000_000).map(f64::from).map(|k| (k, (k * 0.37).sin())).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("figure.svg");
    series(&path, "", "t (s)", "E (J)", false, &[Line { name: "merson".to_owned(), points }]).unwrap();
    // 960 columns of at most four pixels, each of about ten characters.
    assert!(std::fs::metadata(&path).unwrap().len() < 100_000);
}

#[test]
fn a_figure_that_cannot_be_written_is_an_error_with_its_name() {
    let error = work_precision(Path::new("/missing/folder/figure.svg"), "", "", &[]).unwrap_err();
    assert_eq!(error.exit_code(), 4);
    assert!(error.to_string().contains("figure.svg"), "{error}");
}
