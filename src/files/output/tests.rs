//! The file as a reader finds it. One rank writes it through the serial driver.

use std::path::{Path, PathBuf};

use hdf5::types::{FixedAscii, IntSize, TypeDescriptor, VarLenUnicode};
use hdf5::{Dataset, File};
use tempfile::TempDir;

use super::{Contents, Measures, Output, Rows, RunInfo, Seconds};
use crate::domain::comm::Solo;
use crate::error::Error;
use crate::model::columns::{Changes, Column, Columns};
use crate::ode::{Limit, MethodName, NormName};
use crate::scene::SyncEvery;

const COUNT: u64 = 3;
const RADIUS: f64 = 0.1;

fn info(scene: &str) -> RunInfo {
    RunInfo {
        version: "0.1.0".to_string(),
        commit: "0123abc".to_string(),
        scene: scene.to_string(),
        method: MethodName::Merson,
        tolerance: 0.1,
        step: None,
        norm: NormName::Paper,
        velocity_scale: 0.75,
        contact_cutoff: 0.0462,
        energy: false,
        mass: 1.5,
        ranks: 1,
        threads: 2,
        instruction_set: "avx2+fma".to_string(),
    }
}

/// Different numbers in every column, all exact as doubles.
fn measures(k: u64) -> Measures {
    let x = k as f64;
    Measures {
        time: 0.25 * x,
        step: 1.0 + x,
        steps_accepted: 10 + k,
        steps_rejected: 20 + k,
        steps_outrun: 30 + k,
        rhs_evaluations: 40 + k,
        pair_evaluations: 50 + k,
        lists_built: 70 + k,
        forced_accepts: 60 + k,
        limits: std::array::from_fn(|limit| 100 * (limit as u64 + 1) + k),
        kinetic_energy: 2.0 + x,
        potential_energy: 3.0 + x,
        dissipated: [7.0 + x, 8.0 + x],
        largest_overlap: 4.0 + x,
        bed_height: 5.0 + x,
        wall_seconds: 6.0 + x,
        seconds: Seconds {
            forces: 0.5 + x,
            ghosts: 0.25 + x,
            lists: 0.125 + x,
            reduction: 0.0625 + x,
            output: 0.75 + x,
        },
    }
}

/// The vectors of quantity `q` in frame `k`.
fn vectors(k: u64, q: f64) -> Vec<[f64; 3]> {
    (0..COUNT).map(|id| [k as f64, id as f64, q]).collect()
}

fn append(output: &mut Output, k: u64, rotation: bool) {
    let numbers = |column: &Column| match &column.name[..] {
        "position" => vectors(k, 0.5),
        "velocity" => vectors(k, 1.5),
        "angular_velocity" if rotation => vectors(k, 2.5),
        other => panic!("nobody asked for {other}"),
    };
    let numbers = |column: &Column| numbers(column).into_flattened();
    let rows = Rows { first: 0, numbers: &numbers };
    output.append(&rows, &measures(k)).unwrap();
}

/// A finished file of `frames` frames. The folder must exist as long as the file is read.
fn written(frames: u64, rotation: bool, scene: &str) -> (TempDir, File) {
    let (folder, path) = path();
    let mut output = create(&path, rotation, scene);
    for k in 0..frames {
        append(&mut output, k, rotation);
    }
    output.finish(&measures(frames), METHOD, None).unwrap();
    let file = File::open(path).unwrap();
    (folder, file)
}

/// Text about the method, which is written when the run is completed.
const METHOD: &str = "merson, for its ω";

/// A finished file of `frames` frames, whose description `change` has modified.
fn described(frames: u64, change: impl FnOnce(&mut RunInfo)) -> (TempDir, File) {
    let (folder, path) = path();
    let mut info = info("");
    change(&mut info);
    let mut output = create_with(&path, &info, false);
    (0..frames).for_each(|k| append(&mut output, k, false));
    output.finish(&measures(frames), METHOD, None).unwrap();
    (folder, File::open(path).unwrap())
}

fn path() -> (TempDir, PathBuf) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("run.vtkhdf");
    (folder, path)
}

fn create(path: &Path, rotation: bool, scene: &str) -> Output<'static> {
    create_with(path, &info(scene), rotation)
}

fn create_with(path: &Path, info: &RunInfo, rotation: bool) -> Output<'static> {
    let columns = &Columns::new(rotation);
    let contents = Contents { count: COUNT, radius: RADIUS, columns };
    Output::create(&Solo, path, info, &contents, 0..COUNT, &|_| panic!("all columns change")).unwrap()
}

fn counts(file: &File, name: &str) -> Vec<i64> {
    let array = dataset(file, name);
    assert_eq!(
        array.dtype().unwrap().to_descriptor().unwrap(),
        TypeDescriptor::Integer(IntSize::U8),
        "{name}"
    );
    array.read_raw().unwrap()
}

fn reals(file: &File, name: &str) -> Vec<f64> {
    let array = dataset(file, name);
    assert!(array.dtype().unwrap().is::<f64>(), "{name}");
    array.read_raw().unwrap()
}

fn dataset(file: &File, name: &str) -> Dataset {
    file.dataset(name).unwrap_or_else(|why| panic!("{name}: {why}"))
}

fn frames_in(file: &File) -> i64 {
    file.group("VTKHDF/Steps").unwrap().attr("NSteps").unwrap().read_scalar().unwrap()
}

fn run_count(file: &File, name: &str) -> i64 {
    let attribute = file.group("run").unwrap().attr(name).unwrap();
    assert!(attribute.dtype().unwrap().is::<i64>(), "{name}");
    attribute.read_scalar().unwrap()
}

fn run_real(file: &File, name: &str) -> f64 {
    let attribute = file.group("run").unwrap().attr(name).unwrap();
    assert!(attribute.dtype().unwrap().is::<f64>(), "{name}");
    attribute.read_scalar().unwrap()
}

fn run_text(file: &File, name: &str) -> String {
    let attribute = file.group("run").unwrap().attr(name).unwrap();
    attribute.read_scalar::<VarLenUnicode>().unwrap().to_string()
}

fn refusal(path: &Path, force: bool, bytes: u64) -> String {
    match Output::check_path(&Solo, path, force, bytes) {
        Err(Error::Input(text)) => text,
        other => panic!("{other:?}"),
    }
}

#[test]
fn file_says_what_it_is_in_the_types_that_vtk_asks_for() {
    let (_folder, file) = written(1, true, "");
    let root = file.group("VTKHDF").unwrap();
    let kind = root.attr("Type").unwrap();
    assert_eq!(kind.dtype().unwrap().to_descriptor().unwrap(), TypeDescriptor::FixedAscii(8));
    assert_eq!(kind.read_scalar::<FixedAscii<8>>().unwrap().as_str(), "PolyData");
    let version = root.attr("Version").unwrap();
    assert!(version.dtype().unwrap().is::<i64>());
    assert_eq!(version.read_raw::<i64>().unwrap(), [2, 0]);
}

#[test]
fn every_frame_keeps_its_vectors_in_id_order() {
    let (_folder, file) = written(4, true, "");
    for (name, q) in [("Points", 0.5), ("PointData/velocity", 1.5), ("PointData/angular_velocity", 2.5)] {
        let name = format!("VTKHDF/{name}");
        let all: Vec<f64> = (0..4).flat_map(|k| vectors(k, q)).flatten().collect();
        assert_eq!(reals(&file, &name), all, "{name}");
        assert_eq!(dataset(&file, &name).shape(), [4 * COUNT as usize, 3], "{name}");
    }
}

#[test]
fn ids_radii_and_vertices_are_stored_once_for_all_frames() {
    let (_folder, file) = written(2, false, "");
    assert_eq!(counts(&file, "VTKHDF/PointData/id"), [0, 1, 2]);
    assert_eq!(reals(&file, "VTKHDF/PointData/radius"), [RADIUS; 3]);
    assert_eq!(counts(&file, "VTKHDF/Vertices/Connectivity"), [0, 1, 2]);
    assert_eq!(counts(&file, "VTKHDF/Vertices/Offsets"), [0, 1, 2, 3]);
    assert_eq!(counts(&file, "VTKHDF/Vertices/NumberOfCells"), [3, 3]);
    assert_eq!(counts(&file, "VTKHDF/Vertices/NumberOfConnectivityIds"), [3, 3]);
    for cells in ["Lines", "Polygons", "Strips"] {
        assert!(counts(&file, &format!("VTKHDF/{cells}/Connectivity")).is_empty());
        assert_eq!(counts(&file, &format!("VTKHDF/{cells}/Offsets")), [0]);
        assert_eq!(counts(&file, &format!("VTKHDF/{cells}/NumberOfCells")), [0, 0]);
        assert_eq!(counts(&file, &format!("VTKHDF/{cells}/NumberOfConnectivityIds")), [0, 0]);
    }
}

#[test]
fn steps_say_where_each_frame_starts() {
    let (_folder, file) = written(3, true, "");
    assert_eq!(frames_in(&file), 3);
    assert_eq!(reals(&file, "VTKHDF/Steps/Values"), [0.0, 0.25, 0.5]);
    assert_eq!(counts(&file, "VTKHDF/NumberOfPoints"), [3, 3, 3]);
    assert_eq!(counts(&file, "VTKHDF/Steps/PartOffsets"), [0, 1, 2]);
    assert_eq!(counts(&file, "VTKHDF/Steps/NumberOfParts"), [1, 1, 1]);
    assert_eq!(counts(&file, "VTKHDF/Steps/PointOffsets"), [0, 3, 6]);
    for name in ["CellOffsets", "ConnectivityIdOffsets"] {
        let name = format!("VTKHDF/Steps/{name}");
        assert_eq!(counts(&file, &name), [0; 12]);
        assert_eq!(dataset(&file, &name).shape(), [3, 4]);
    }
    for (name, starts) in
        [("id", [0; 3]), ("radius", [0; 3]), ("velocity", [0, 3, 6]), ("angular_velocity", [0, 3, 6])]
    {
        assert_eq!(counts(&file, &format!("VTKHDF/Steps/PointDataOffsets/{name}")), starts, "{name}");
    }
}

#[test]
fn every_point_array_has_offsets_and_without_rotation_there_is_no_angular_velocity() {
    for (rotation, names) in [
        (true, &["angular_velocity", "id", "radius", "velocity"][..]),
        (false, &["id", "radius", "velocity"]),
    ] {
        let (_folder, file) = written(1, rotation, "");
        for group in ["VTKHDF/PointData", "VTKHDF/Steps/PointDataOffsets"] {
            assert_eq!(file.group(group).unwrap().member_names().unwrap(), names, "{group}");
        }
    }
}

#[test]
fn columns_that_do_not_change_are_written_once_and_only_if_they_belong_in_the_file() {
    let (_folder, path) = path();
    let mut columns = Columns::new(false);
    for (name, width, in_file) in [("mass", 1, true), ("hidden", 1, false), ("tag", 2, true)] {
        let (name, unit, changes) = (name.to_owned(), "1".to_owned(), Changes::WithLists);
        columns.push(Column { name, width, unit, changes, in_file, names: Vec::new() });
    }
    let contents = Contents { count: COUNT, radius: RADIUS, columns: &columns };
    let constants = |column: &Column| match column.width {
        1 => vec![1.0, 2.0, 3.0],
        _ => vec![0.0, 10.0, 1.0, 11.0, 2.0, 12.0],
    };
    let mut output = Output::create(&Solo, &path, &info(""), &contents, 0..COUNT, &constants).unwrap();
    append(&mut output, 0, false);
    append(&mut output, 1, false);
    output.stop("a test").unwrap();
    // A later process goes on with the file.
    let mut output = Output::open(&Solo, &path, false, &contents, 2).unwrap();
    append(&mut output, 2, false);
    output.finish(&measures(3), METHOD, None).unwrap();
    let file = File::open(&path).unwrap();
    assert_eq!(reals(&file, "VTKHDF/PointData/mass"), [1.0, 2.0, 3.0]);
    let tags = dataset(&file, "VTKHDF/PointData/tag");
    assert_eq!(
        (tags.shape(), tags.read_raw::<f64>().unwrap()),
        (vec![3, 2], vec![0.0, 10.0, 1.0, 11.0, 2.0, 12.0])
    );
    for name in ["mass", "tag"] {
        assert_eq!(counts(&file, &format!("VTKHDF/Steps/PointDataOffsets/{name}")), [0; 3], "{name}");
    }
    assert!(!file.link_exists("VTKHDF/PointData/hidden"));
    // A run that begins again from the file has them.
    let found = super::first_frame(&path, COUNT).unwrap();
    let names: Vec<_> = found.columns.iter().map(|(column, _)| &column.name[..]).collect();
    assert_eq!(names, ["mass", "tag"]);
    assert!(found.columns.iter().all(|(column, numbers)| *numbers == constants(column)));
}

#[test]
fn series_has_one_row_of_measures_for_each_frame() {
    let (_folder, file) = written(3, false, "");
    for (name, start) in
        [("step", 1.0), ("kinetic_energy", 2.0), ("potential_energy", 3.0), ("largest_overlap", 4.0)]
            .into_iter()
            .chain([("bed_height", 5.0), ("wall_seconds", 6.0)])
    {
        assert_eq!(reals(&file, &format!("run/series/{name}")), [start, start + 1.0, start + 2.0], "{name}");
    }
    assert_eq!(reals(&file, "run/series/time"), [0.0, 0.25, 0.5]);
    for (name, start) in
        [("steps_accepted", 10), ("steps_rejected", 20), ("steps_outrun", 30), ("rhs_evaluations", 40)]
            .into_iter()
            .chain([("pair_evaluations", 50), ("lists_built", 70)])
    {
        assert_eq!(counts(&file, &format!("run/series/{name}")), [start, start + 1, start + 2], "{name}");
    }
    assert_eq!(file.group("run/series").unwrap().len(), 13);
}

#[test]
fn dissipated_energy_has_columns_only_where_it_is_asked_for() {
    let names = ["dissipated_rebound", "dissipated_friction"].map(|name| format!("run/series/{name}"));
    let (_folder, file) = described(2, |_| ());
    assert!(names.iter().all(|name| !file.link_exists(name)));
    let (_folder, file) = described(2, |info| info.energy = true);
    assert_eq!(reals(&file, &names[0]), [7.0, 8.0]);
    assert_eq!(reals(&file, &names[1]), [8.0, 9.0]);
    assert_eq!(file.group("run/series").unwrap().len(), 15);
}

#[test]
fn run_counts_the_steps_that_every_limit_decided() {
    let (_folder, file) = described(2, |_| ());
    for (k, limit) in Limit::ALL.into_iter().enumerate() {
        let name = format!("limited_by_{}", limit.name());
        assert_eq!(run_count(&file, &name), 100 * (k as i64 + 1) + 2, "{name}");
    }
}

#[test]
fn seconds_of_a_killed_run_are_those_of_its_last_frame() {
    let names = ["forces", "ghosts", "lists", "reduction", "output"].map(|part| format!("seconds_{part}"));
    let (_folder, path) = path();
    let mut output = create(&path, false, "");
    append(&mut output, 0, false);
    append(&mut output, 1, false);
    drop(output);
    let (_other, completed) = described(2, |_| ());
    for (file, k) in [(File::open(path).unwrap(), 1.0), (completed, 2.0)] {
        let found: Vec<f64> = names.iter().map(|name| run_real(&file, name)).collect();
        assert_eq!(found, [0.5, 0.25, 0.125, 0.0625, 0.75].map(|part| part + k));
    }
}

#[test]
fn a_run_goes_on_in_a_file_that_does_not_know_of_its_last_chunks() {
    // The run was killed in the first frame of these chunks. The trees of the arrays were on the disk, the
    // new end of the file was not.
    let (_folder, path) = path();
    let mut output = create(&path, false, "");
    let end = 40..48; // the end of the file, in the superblock
    let mut old = Vec::new();
    for k in 0..915 {
        append(&mut output, k, false);
        if k == 900 {
            old = std::fs::read(&path).unwrap()[end.clone()].to_vec();
        }
    }
    drop(output);
    let mut bytes = std::fs::read(&path).unwrap();
    assert!(bytes[end.clone()] != old[..], "a chunk holds less than 910 frames of 3 particles");
    bytes[end].copy_from_slice(&old);
    std::fs::write(&path, bytes).unwrap();
    super::prepare(&path, 912, &info("")).unwrap();
    let contents = Contents { count: COUNT, radius: RADIUS, columns: &Columns::new(false) };
    let mut output = Output::open(&Solo, &path, false, &contents, 912).unwrap();
    (912..1830).for_each(|k| append(&mut output, k, false));
    output.finish(&measures(1830), METHOD, None).unwrap();
    let file = File::open(&path).unwrap();
    assert_eq!(frames_in(&file), 1830);
    let expected = |q| (0..1830).flat_map(|k| vectors(k, q).concat()).collect::<Vec<f64>>();
    assert_eq!(reals(&file, "VTKHDF/Points"), expected(0.5));
    assert_eq!(reals(&file, "VTKHDF/PointData/velocity"), expected(1.5));
    assert_eq!(reals(&file, "run/series/time"), (0..1830).map(|k| 0.25 * f64::from(k)).collect::<Vec<_>>());
}

#[test]
fn frames_without_times_are_not_complete() {
    // What a kill between the two writes that declare frames complete leaves.
    let (_folder, path) = path();
    let mut output = create(&path, false, "");
    (0..5).for_each(|k| append(&mut output, k, false));
    drop(output);
    File::open_rw(&path).unwrap().dataset("VTKHDF/Steps/Values").unwrap().resize(3).unwrap();
    let found = super::inspect(&path).unwrap();
    assert_eq!((found.frames, found.times), (3, vec![0.0, 0.25, 0.5]));
}

#[test]
fn a_run_that_was_killed_in_its_first_flush_has_no_frames() {
    // The arrays know of their first chunks. The new end of the file, in the superblock, was not on the disk.
    let (_folder, path) = path();
    let mut output = create(&path, false, "");
    let end = 40..48;
    let old = std::fs::read(&path).unwrap()[end.clone()].to_vec();
    append(&mut output, 0, false);
    drop(output);
    let file = File::open_rw(&path).unwrap();
    file.group("VTKHDF/Steps").unwrap().attr("NSteps").unwrap().write_scalar(&0_i64).unwrap();
    file.close().unwrap();
    let mut bytes = std::fs::read(&path).unwrap();
    bytes[end].copy_from_slice(&old);
    std::fs::write(&path, bytes).unwrap();
    let file = File::open(&path).unwrap();
    assert!(file.dataset("VTKHDF/Steps/Values").and_then(|times| times.read_raw::<f64>()).is_err());
    let found = super::inspect(&path).unwrap();
    assert_eq!((found.frames, found.times), (0, vec![]));
}

#[test]
fn arrays_that_are_longer_than_their_chunks_are_cut_to_them() {
    let (_folder, path) = path();
    let mut output = create(&path, true, "");
    (0..905).for_each(|k| append(&mut output, k, true));
    drop(output);
    let file = File::open_rw(&path).unwrap();
    let names = ["VTKHDF/Points", "VTKHDF/PointData/velocity", "VTKHDF/PointData/angular_velocity"];
    for name in names {
        dataset(&file, name).resize((2740, 3)).unwrap();
    }
    for name in ["VTKHDF/Steps/PointOffsets", "VTKHDF/Vertices/NumberOfCells"] {
        dataset(&file, name).resize(1030).unwrap();
    }
    file.close().unwrap();
    super::prepare(&path, 903, &info("")).unwrap();
    let file = File::open(&path).unwrap();
    // A chunk of vectors has 910 frames of 3 particles; one of the small arrays 1024 frames.
    for name in names {
        assert_eq!(dataset(&file, name).shape(), [2730, 3], "{name}");
    }
    for name in ["VTKHDF/Steps/PointOffsets", "VTKHDF/Vertices/NumberOfCells"] {
        assert_eq!(dataset(&file, name).shape(), [1024], "{name}");
    }
    assert_eq!(dataset(&file, "VTKHDF/PointData/id").shape(), [3]);
}

#[test]
fn a_fixed_step_is_an_attribute_only_of_a_method_that_has_one() {
    let (_folder, file) = described(0, |_| ());
    assert!(file.group("run").unwrap().attr("step").is_err());
    assert_eq!(run_real(&file, "tolerance"), 0.1);
    let (_folder, file) = described(0, |info| (info.step, info.tolerance) = (Some(1e-5), 0.0));
    assert_eq!((run_real(&file, "step"), run_real(&file, "tolerance")), (1e-5, 0.0));
}

#[test]
fn the_method_that_took_the_steps_is_told_when_the_run_is_completed() {
    let (_folder, path) = path();
    let mut output = create(&path, false, "");
    append(&mut output, 0, false);
    drop(output);
    assert!(File::open(&path).unwrap().group("run").unwrap().attr("choice").is_err());
    let (_folder, file) = described(1, |_| ());
    assert_eq!(run_text(&file, "choice"), METHOD);
}

#[test]
fn run_attributes_follow_the_last_frame_until_the_run_is_completed() {
    let (_folder, path) = path();
    let mut output = create(&path, true, "");
    append(&mut output, 0, true);
    append(&mut output, 1, true);
    assert_eq!(output.transfer_report(), "serial");
    drop(output);
    let file = File::open(&path).unwrap();
    assert_eq!(frames_in(&file), 2);
    assert_eq!((run_count(&file, "steps_accepted"), run_count(&file, "forced_accepts")), (11, 61));
    assert_eq!(run_count(&file, "completed"), 0);
    let (_folder, file) = written(2, true, "");
    assert_eq!((run_count(&file, "steps_accepted"), run_count(&file, "forced_accepts")), (12, 62));
    assert_eq!((run_count(&file, "steps_rejected"), run_count(&file, "steps_outrun")), (22, 32));
    assert_eq!((run_count(&file, "rhs_evaluations"), run_count(&file, "completed")), (42, 1));
    assert_eq!((run_count(&file, "pair_evaluations"), run_count(&file, "lists_built")), (52, 72));
    assert_eq!(run_real(&file, "wall_seconds"), 8.0);
}

#[test]
fn run_describes_itself_in_utf8() {
    let scene = "# Größe ω\nt_end = 1.0\n";
    let (_folder, file) = written(0, false, scene);
    assert_eq!(run_text(&file, "scene"), scene);
    assert_eq!(run_text(&file, "version"), "0.1.0");
    assert_eq!(run_text(&file, "commit"), "0123abc");
    assert_eq!(run_text(&file, "method"), "merson");
    assert_eq!(run_text(&file, "instruction_set"), "avx2+fma");
    assert_eq!((run_count(&file, "ranks"), run_count(&file, "threads")), (1, 2));
    assert_eq!(run_text(&file, "norm"), "paper");
    for (name, value) in
        [("tolerance", 0.1), ("velocity_scale", 0.75), ("contact_reach", 0.0462), ("mass", 1.5)]
    {
        assert_eq!(run_real(&file, name), value, "{name}");
    }
    assert!(!file.group("run").unwrap().link_exists("scene_text"));
}

#[test]
fn long_scene_becomes_a_dataset_of_the_same_text() {
    let scene = "# ω\n".repeat(15_000);
    let (_folder, file) = written(0, false, &scene);
    assert!(file.group("run").unwrap().attr("scene").is_err());
    let text = dataset(&file, "run/scene_text");
    let kind = text.dtype().unwrap().to_descriptor().unwrap();
    assert_eq!(kind, TypeDescriptor::FixedUnicode(scene.len()));
    assert!(text.is_scalar());
    let path = file.filename();
    drop((text, file));
    // The crate cannot read strings whose length is known only at run time: look for the bytes in the file.
    let bytes = std::fs::read(path).unwrap();
    assert!(bytes.windows(scene.len()).any(|window| window == scene.as_bytes()));
}

#[test]
fn file_without_frames_is_ready_for_a_reader() {
    let (_folder, file) = written(0, true, "");
    assert_eq!(frames_in(&file), 0);
    assert_eq!(reals(&file, "VTKHDF/Steps/Values"), [0.0; 0]);
    assert_eq!(reals(&file, "VTKHDF/Points"), [0.0; 0]);
    assert_eq!(counts(&file, "VTKHDF/PointData/id"), [0, 1, 2]);
}

#[test]
fn after_a_failed_write_the_file_is_not_touched_any_more() {
    let (_folder, path) = path();
    let mut output = create(&path, false, "");
    append(&mut output, 0, false);
    let why = output.guarded(|_| Err::<(), _>("the disk\n is gone".into())).unwrap_err();
    assert_eq!(why.to_string(), format!("cannot write to {}: the disk is gone", path.display()));
    let before = std::fs::read(&path).unwrap();
    let rows = Rows { first: 0, numbers: &|_| panic!("nothing is to be written") };
    assert!(output.append(&rows, &measures(1)).is_err());
    assert_eq!(output.finish(&measures(1), METHOD, None).unwrap_err().exit_code(), 4);
    assert_eq!(std::fs::read(&path).unwrap(), before);
}

#[test]
fn good_path_is_answered_with_its_absolute_path_and_nothing_is_created() {
    let (_folder, path) = path();
    assert_eq!(Output::check_path(&Solo, &path, false, 1000).unwrap(), path);
    assert!(!path.exists());
    let relative = Output::check_path(&Solo, Path::new("unlikely-to-exist.vtkhdf"), false, 0).unwrap();
    assert_eq!(relative, std::env::current_dir().unwrap().join("unlikely-to-exist.vtkhdf"));
}

#[test]
fn existing_file_is_replaced_only_by_force() {
    let (_folder, path) = path();
    std::fs::write(&path, "precious").unwrap();
    let text = refusal(&path, false, 0);
    assert!(text.starts_with(&format!("output.file = \"{}\"", path.display())), "{text}");
    assert!(text.contains("the file exists") && text.contains("--force"), "{text}");
    assert_eq!(Output::check_path(&Solo, &path, true, 0).unwrap(), path);
    assert_eq!(std::fs::read(&path).unwrap(), b"precious");
}

#[test]
fn path_that_cannot_work_is_refused_with_what_would_be_right() {
    let (folder, path) = path();
    assert!(refusal(folder.path(), true, 0).contains("is a folder; name a file in it"));
    assert!(refusal(Path::new("results/"), true, 0).contains("names a folder"));
    assert!(refusal(Path::new(""), true, 0).contains("give the name of a file"));
    assert!(refusal(&folder.path().join("no/run.vtkhdf"), false, 0).contains("create it first"));
    assert!(refusal(Path::new("/dev/null"), true, 0).contains("not a regular file"));
    std::fs::write(&path, "").unwrap();
    assert!(refusal(&path.join("run.vtkhdf"), false, 0).contains("choose another path"));
    let text = refusal(&path, true, 1 << 62);
    assert!(text.contains("the run needs about 4194304.0 TiB") && text.contains("output.interval"), "{text}");
}

#[test]
fn frames_that_are_held_are_the_same_in_the_file_whatever_they_waited_for() {
    let (_folder, every) = written(150, true, "");
    for sync in [SyncEvery::Seconds(5.0), SyncEvery::Seconds(1e300), SyncEvery::End] {
        let (_folder, path) = path();
        let mut output = create(&path, true, "").with_sync(sync);
        (0..150).for_each(|k| append(&mut output, k, true));
        output.finish(&measures(150), METHOD, None).unwrap();
        let file = File::open(path).unwrap();
        assert_eq!(frames_in(&file), 150, "{sync:?}");
        for name in ["Points", "PointData/velocity", "PointData/angular_velocity", "Steps/Values"] {
            let name = format!("VTKHDF/{name}");
            assert_eq!(reals(&file, &name), reals(&every, &name), "{name}, {sync:?}");
        }
        for name in ["NumberOfPoints", "Steps/PartOffsets", "Steps/PointOffsets", "Steps/CellOffsets"] {
            let name = format!("VTKHDF/{name}");
            assert_eq!(counts(&file, &name), counts(&every, &name), "{name}, {sync:?}");
        }
        for name in ["run/series/steps_accepted", "run/series/lists_built"] {
            assert_eq!(counts(&file, name), counts(&every, name), "{name}, {sync:?}");
        }
        assert_eq!(reals(&file, "run/series/bed_height"), reals(&every, "run/series/bed_height"));
    }
}

#[test]
fn frames_wait_in_memory_as_long_as_the_scene_allows_and_dropping_writes_them() {
    // The wall time of frame k is 6 + k seconds.
    for (sync, on_disk) in [
        (SyncEvery::Frame, [1, 2, 3, 4, 5, 6]),
        (SyncEvery::Seconds(0.5), [1, 2, 3, 4, 5, 6]),
        (SyncEvery::Seconds(3.0), [1, 1, 3, 3, 5, 5]),
        (SyncEvery::Seconds(1e300), [1; 6]),
        (SyncEvery::End, [0; 6]),
    ] {
        let (_folder, path) = path();
        let mut output = create(&path, false, "").with_sync(sync);
        for (k, frames) in (0..).zip(on_disk) {
            append(&mut output, k, false);
            // A copy is what a kill at this moment would leave.
            let copy = path.with_extension("copy");
            std::fs::copy(&path, &copy).unwrap();
            let file = File::open(&copy).unwrap();
            assert_eq!(
                (frames_in(&file), reals(&file, "VTKHDF/Steps/Values").len()),
                (frames, frames as usize)
            );
        }
        drop(output);
        assert_eq!(frames_in(&File::open(&path).unwrap()), 6, "{sync:?}");
    }
}

#[test]
fn no_more_is_held_than_memory_is_meant_for_it() {
    let (_folder, path) = path();
    let mut output = create(&path, false, "").with_sync(SyncEvery::End);
    for k in 0..1025 {
        append(&mut output, k, false);
    }
    let copy = path.with_extension("copy");
    std::fs::copy(&path, &copy).unwrap();
    assert_eq!(frames_in(&File::open(&copy).unwrap()), 1024);
    output.sync().unwrap();
    std::fs::copy(&path, &copy).unwrap();
    assert_eq!(frames_in(&File::open(&copy).unwrap()), 1025);
}
