//! `demhybrid render` as a user meets it: files, legends, animations, mistakes.

use crate::mpirun::Job;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;
use tempfile::TempDir;

const WHITE: [u8; 3] = [255; 3];
/// The ends of the colours.
const FIRST: [u8; 3] = [68, 1, 84];
const LAST: [u8; 3] = [253, 231, 37];

/// A run of two spheres without gravity, one at rest, one that moves to the right: frames at 0, 0.5 and 1 s.
fn run() -> TempDir {
    run_of("radius = 0.1\nmass = 1.0", "x,y,z,vx,vy,vz\n0,0,0,0,0,0\n0.5,0,1,1,0,0\n")
}

/// A run without gravity of spheres whose sizes are `particles` and which start from the table `start`.
fn run_of(particles: &str, start: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    let scene = format!(
        "
t_end = 1.0
[particles]
{particles}
file = 'start.csv'
[contact]
repulsion_at_contact = 10.0
stiffness_exponent = 150.0
restitution = 0.4
dissipation_focusing = 10.0
interaction_distance = 0.1
[output]
interval = 0.5
"
    );
    fs::write(folder.path().join("two.toml"), scene).unwrap();
    fs::write(folder.path().join("start.csv"), start).unwrap();
    Job::alone(folder.path(), &["two.toml", "-q"]).run().with_code(0);
    folder
}

fn render(folder: &TempDir, options: &str) -> String {
    let arguments: Vec<&str> =
        ["render", "two.vtkhdf"].into_iter().chain(options.split_whitespace()).collect();
    Job::alone(folder.path(), &arguments).run().with_code(0).stderr
}

/// Width, height and pixels.
fn png(path: &Path) -> (usize, usize, Vec<[u8; 3]>) {
    let mut reader = png::Decoder::new(BufReader::new(File::open(path).unwrap())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!(info.color_type, png::ColorType::Rgb);
    (info.width as usize, info.height as usize, bytes.as_chunks::<3>().0.to_vec())
}

#[test]
fn a_picture_has_spheres_legend_and_time() {
    let folder = run();
    let told = render(&folder, "-o a.png --size 600x400 --direction 0,-1,0 --projection orthographic");
    assert!(told.contains("a.png is drawn"), "{told}");
    let (width, height, pixels) = png(&folder.path().join("a.png"));
    assert_eq!((width, height), (600, 400));
    let count =
        |columns: std::ops::Range<usize>, rows: std::ops::Range<usize>, is: &dyn Fn([u8; 3]) -> bool| {
            rows.flat_map(|row| columns.clone().map(move |column| row * 600 + column))
                .filter(|&k| is(pixels[k]))
                .count()
        };
    let inked = |pixel: [u8; 3]| pixel != WHITE;
    // The time and the bar with its two ends to the right, dark letters and lines; nothing in the corner
    // below.
    assert!(count(475..600, 0..40, &inked) > 50);
    assert!(count(475..600, 40..360, &|pixel| pixel == FIRST) >= 20);
    assert!(count(475..600, 40..360, &|pixel| pixel == LAST) >= 20);
    assert!(count(475..600, 40..360, &|pixel| pixel == [24; 3]) > 100);
    assert_eq!(count(475..600, 385..400, &inked), 0);
    // The spheres: the lower one violet, the upper one, further right, yellow.
    let yellow = |pixel: [u8; 3]| pixel[0] > 120 && pixel[1] > 100 && pixel[2] < 100;
    let violet = |pixel: [u8; 3]| pixel[0] > pixel[1] && pixel[2] > pixel[1] && inked(pixel);
    assert!(count(0..470, 0..200, &yellow) > 500 && count(0..470, 200..400, &violet) > 500);
    assert_eq!(count(0..470, 200..400, &yellow), 0);

    render(&folder, "-o plain.png --size 600x400 --plain --background 102030");
    let (_, _, plain) = png(&folder.path().join("plain.png"));
    assert!(plain[599] == [0x10, 0x20, 0x30] && !plain.contains(&[236; 3]));
}

#[test]
fn a_range_fixes_the_colours() {
    let folder = run();
    let colours = |options: &str| {
        render(&folder, &format!("-o a.png --size 500x400 --force --plain --colour speed {options}"));
        png(&folder.path().join("a.png")).2
    };
    // Speeds are 0 and 1 m/s: beyond this range the colour is that of its end, so that both are violet, or
    // yellow.
    let is_yellow = |pixel: &[u8; 3]| pixel[0] > 100 && pixel[1] > pixel[2];
    assert!(!colours("--range 2,3").iter().any(|pixel| is_yellow(pixel) && *pixel != WHITE));
    assert!(colours("--range -2,-1").iter().all(|pixel| *pixel == WHITE || pixel[1] >= pixel[2]));
    assert!(colours("").iter().any(|pixel| is_yellow(pixel) && *pixel != WHITE));
}

#[test]
fn the_same_bytes_come_from_any_number_of_threads() {
    let folder = run();
    for threads in ["1", "2", "3"] {
        render(&folder, &format!("-o {threads}.png --size 500x400 --threads {threads}"));
    }
    let [one, two, three] =
        ["1.png", "2.png", "3.png"].map(|name| fs::read(folder.path().join(name)).unwrap());
    assert!(one == two && one == three);
}

#[test]
fn animations_hold_all_frames_seen_alike() {
    let folder = run();
    let options = "--frame all --size 400x300 --direction 0,-1,0 --projection orthographic";
    render(&folder, &format!("-o film.png {options}"));
    let pictures: Vec<Vec<[u8; 3]>> =
        (0..3).map(|k| png(&folder.path().join(format!("film-000{k}.png"))).2).collect();
    // The camera stands still: the sphere at rest, below the middle, is the same in all, and the other one
    // moves.
    let below = |k: usize| &pictures[k][180 * 400..];
    assert!(below(0) == below(1) && below(1) == below(2) && below(0).iter().any(|&pixel| pixel != WHITE));
    assert!(pictures[0] != pictures[1] && pictures[1] != pictures[2]);

    render(&folder, &format!("-o film.apng {options} --fps 10"));
    let file = BufReader::new(File::open(folder.path().join("film.apng")).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    assert_eq!(reader.info().animation_control().unwrap().num_frames, 3);
    for picture in &pictures {
        let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut bytes).unwrap();
        assert!(bytes == picture.as_flattened());
    }

    render(&folder, &format!("-o film.gif {options} --fps 10"));
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut reader = options.read_info(File::open(folder.path().join("film.gif")).unwrap()).unwrap();
    for picture in &pictures {
        let frame = reader.read_next_frame().unwrap().expect("a frame for every picture");
        assert_eq!((frame.width, frame.height, frame.delay), (400, 300, 10));
        let apart = |(a, b): (&[u8; 4], &[u8; 3])| (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap();
        let apart: Vec<u8> = frame.buffer.as_chunks::<4>().0.iter().zip(picture).map(apart).collect();
        // 256 colours for all frames.
        let mean = apart.iter().map(|&a| f64::from(a)).sum::<f64>() / apart.len() as f64;
        assert!(mean < 1.0 && apart.iter().all(|&a| a < 60), "{mean} {:?}", apart.iter().max());
    }
    assert!(reader.read_next_frame().unwrap().is_none());
}

#[test]
fn an_existing_picture_is_kept_unless_told_otherwise() {
    let folder = run();
    let path = folder.path().join("a-0001.png");
    fs::write(&path, "precious").unwrap();
    let refused = Job::alone(folder.path(), &["render", "two.vtkhdf", "-o", "a.png", "--frame", "all"])
        .run()
        .with_code(2);
    assert!(refused.stderr.contains("a-0001.png: the file exists; use --force"), "{}", refused.stderr);
    assert!(fs::read_to_string(&path).unwrap() == "precious" && !folder.path().join("a-0000.png").exists());
    render(&folder, "-o a.png --frame all --force --size 300x300");
    assert_eq!(png(&path).0, 300);
}

#[test]
fn mistakes_name_option_and_value_and_write_nothing() {
    let folder = run();
    for (options, parts) in [
        ("-o a.jpg", vec!["--output a.jpg", ".png"]),
        ("-o no/a.png", vec!["--output no/a.png", "no folder no"]),
        ("-o a.png --frame 3", vec!["--frame 3", "0 to 2"]),
        ("-o a.png --frame first", vec!["'first'", "--frame", "last, all"]),
        ("-o a.png --size 1280", vec!["'1280'", "--size", "1280x960"]),
        ("-o a.png --size 100x100", vec!["--size 100x100", "--plain"]),
        ("-o a.png --colour mass", vec!["'mass'", "--colour", "height"]),
        ("-o a.png --colour spin", vec!["--colour spin", "do not rotate"]),
        ("-o a.png --range 1", vec!["'1'", "--range", "two numbers"]),
        ("-o a.png --range 2,1", vec!["'2,1'", "--range", "less than"]),
        ("-o a.png --direction 0,0,0", vec!["--direction 0,0,0", "zero"]),
        ("-o a.png --direction 1,2", vec!["'1,2'", "--direction", "three numbers"]),
        ("-o a.png --from 1,2,3 --target 1,2,3", vec!["--from 1,2,3", "--target"]),
        ("-o a.png --up inf,0,0", vec!["'inf,0,0'", "--up", "finite"]),
        ("-o a.png --zoom 0", vec!["'0'", "--zoom", "greater than 0"]),
        ("-o a.png --background red", vec!["'red'", "--background", "RRGGBB"]),
        ("-o a.gif --fps 0", vec!["0", "--fps", "1..=50"]),
        ("", vec!["--output <FILE>"]),
    ] {
        let arguments: Vec<&str> =
            ["render", "two.vtkhdf"].into_iter().chain(options.split_whitespace()).collect();
        let refused = Job::alone(folder.path(), &arguments).run().with_code(2);
        for part in parts {
            assert!(refused.stderr.contains(part), "{options}: no {part} in\n{}", refused.stderr);
        }
        assert!(refused.stdout.is_empty());
    }
    assert!(!folder.path().join("a.png").exists() && !folder.path().join("a.gif").exists());
    let missing = Job::alone(folder.path(), &["render", "none.vtkhdf", "-o", "a.png"]).run().with_code(2);
    assert!(missing.stderr.contains("none.vtkhdf: there is no such file"), "{}", missing.stderr);
}

/// A run of three spheres at rest: one of 0.4 m, one of 0.1 m on its right, a tiny one on its left, all in a
/// row along x; two species.
fn sized_run() -> TempDir {
    let start = "x,y,z,radius,species\n0,0,0,0.4,gravel\n0.7,0,0,0.1,sand\n-0.7,0,0,0.02,sand\n";
    run_of("density = 2500.0", start)
}

#[test]
fn spheres_are_drawn_with_their_own_radii_and_coloured_by_them() {
    let folder = sized_run();
    let front = "--size 820x460 --direction 0,-1,0 --projection orthographic --no-container";
    render(&folder, &format!("-o a.png --plain --colour radius {front}"));
    let (width, _, pixels) = png(&folder.path().join("a.png"));
    // The camera shows all from x = -0.72 m to 0.8 m, in 820 columns less a margin of 19 on each side.
    let metre = 782.0 / 1.52;
    let middle = |x: f64| 19.0 + (x + 0.72) * metre;
    let count = |from: f64, to: f64, is: &dyn Fn([u8; 3]) -> bool| {
        let inside = |k: usize| (from..to).contains(&((k % width) as f64 + 0.5));
        (0..pixels.len()).filter(|&k| inside(k) && is(pixels[k])).count() as f64
    };
    let inked = |pixel: [u8; 3]| pixel != WHITE;
    for (x, r) in [(0.0, 0.4), (0.7, 0.1), (-0.7, 0.02)] {
        let (from, to) = (middle(x - 1.1 * r), middle(x + 1.1 * r));
        let area = std::f64::consts::PI * (r * metre).powi(2);
        // Half of the pixels on the rim are too many.
        let rim = std::f64::consts::TAU * r * metre;
        let found = count(from, to, &inked);
        assert!((found - area).abs() < rim, "{r}: {found} pixels for {area}");
    }
    // The largest one has the last colour, the tiny one the first.
    let yellow = |pixel: [u8; 3]| pixel[0] > 110 && pixel[1] > 90 && pixel[2] < 100;
    let violet = |pixel: [u8; 3]| pixel[2] > pixel[1] && pixel != WHITE && pixel[1] < 90;
    assert!(count(middle(-0.4), middle(0.4), &yellow) > 20_000.0);
    assert!(count(middle(-0.73), middle(-0.67), &violet) > 100.0);

    render(&folder, &format!("-o b.png --colour species {front}"));
    let (_, _, pixels) = png(&folder.path().join("b.png"));
    // Both species have a square of their colour in the legend, and spheres of its hue: blue and orange.
    for colour in [[78, 121, 167], [242, 142, 44]] {
        let squares = pixels.iter().filter(|&&pixel| pixel == colour).count();
        assert!(squares >= 16 * 16, "{colour:?}: {squares}");
    }
}

#[test]
fn colours_by_what_a_run_does_not_have_are_refused() {
    let refused = |folder: &TempDir, options: &str, part: &str| {
        let line = format!("render two.vtkhdf -o a.png {options}");
        let words: Vec<&str> = line.split_whitespace().collect();
        let ended = Job::alone(folder.path(), &words).run().with_code(2);
        assert!(ended.stderr.contains(part), "{}", ended.stderr);
        assert!(!folder.path().join("a.png").exists());
    };
    let alike = run();
    refused(&alike, "--colour radius", "--colour radius: all spheres of two.vtkhdf have the radius 0.1 m");
    refused(&alike, "--colour species", "--colour species: the spheres of two.vtkhdf have none");
    refused(&sized_run(), "--colour species --range 0,1", "its colours have no --range");
}
