//! `demhybrid export` through the real program: a bed that starts the next run, and every format in its
//! reader.
//!
//! VTK and numpy come with .venv (tests/readers.rs says how). LAMMPS and OVITO are read with the feature
//! `long-tests` by launch/test-long.sh, which names them by LAMMPS and OVITO_PYTHON.

use crate::mpirun::{Job, PACKAGE, kill};
use crate::python::{python, run_python};
use demhybrid::files::run_file::{RunFile, State, Which};
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// A folder with quick.vtkhdf, 16 frames of quick.toml up to 0.3 s; and `more`.
fn quick(more: &[&str]) -> TempDir {
    let folder = TempDir::new().unwrap();
    let scene = format!("{PACKAGE}/configs/quick.toml");
    Job::alone(folder.path(), &[&scene, "-q", "--set", "t_end=0.3"]).and(more).run().with_code(0);
    folder
}

#[track_caller]
fn export(folder: &Path, line: &str) -> crate::mpirun::Ended {
    let words: Vec<&str> = ["export"].into_iter().chain(line.split_whitespace()).collect();
    Job::alone(folder, &words).run()
}

fn state(folder: &Path, run: &str, which: Which) -> State {
    let run_file = RunFile::open(&folder.join(run)).unwrap();
    let frame = run_file.numbers(which).unwrap()[0];
    run_file.state(frame).unwrap()
}

fn bits(state: &State) -> Vec<u64> {
    state.x.iter().chain(&state.v).flatten().map(|number| number.to_bits()).collect()
}

fn angular(state: &State) -> impl Iterator<Item = f64> {
    state.omega.iter().flatten().flatten().copied()
}

#[test]
fn a_bed_in_csv_starts_the_next_run_where_the_last_one_ended() {
    for (more, header) in [
        (&["--set", "friction.rotation=true"], "x,y,z,vx,vy,vz,avx,avy,avz"),
        (&["--set", "friction.coefficient=0"], "x,y,z,vx,vy,vz"),
    ] {
        let folder = quick(more);
        let said = export(folder.path(), "quick.vtkhdf --to csv -o bed.csv").with_code(0);
        assert!(said.stderr.contains("frame 15 of quick.vtkhdf, 27 spheres"), "{}", said.stderr);
        let table = fs::read_to_string(folder.path().join("bed.csv")).unwrap();
        assert_eq!(table.lines().next(), Some(header));
        assert_eq!(table.lines().count(), 28);

        let scene = fs::read_to_string(format!("{PACKAGE}/configs/quick.toml")).unwrap();
        let (head, rest) = scene.split_once("[particles.grid]").unwrap();
        let (_, tail) = rest.split_once("[container]").unwrap();
        let next = format!("{head}file = 'bed.csv'\n[container]{tail}");
        fs::write(folder.path().join("next.toml"), next).unwrap();
        Job::alone(folder.path(), &["next.toml", "-q", "--set", "t_end=0.02"]).and(more).run().with_code(0);
        let end = state(folder.path(), "quick.vtkhdf", Which::Last);
        let start = state(folder.path(), "next.vtkhdf", Which::Number(0));
        assert_eq!(bits(&end), bits(&start));
        // A run keeps r w: the product and the quotient by r round once each.
        for (end, start) in angular(&end).zip(angular(&start)) {
            assert!((end - start).abs() <= f64::EPSILON * end.abs(), "{end:e} {start:e}");
        }
        assert!(end.v.iter().flatten().any(|v| *v != 0.0));
    }
}

#[test]
fn all_frames_go_to_numbered_files_and_xyz_to_one() {
    let folder = quick(&[]);
    let at = |name: &str| folder.path().join(name);
    export(folder.path(), "quick.vtkhdf --to csv -o a.csv --frame all").with_code(0);
    assert!(at("a-0000.csv").exists() && at("a-0015.csv").exists() && !at("a-0016.csv").exists());
    export(folder.path(), "quick.vtkhdf --to csv -o b.csv --frame 7").with_code(0);
    let one = fs::read(at("b.csv")).unwrap();
    assert_eq!(fs::read(at("a-0007.csv")).unwrap(), one);
    assert_ne!(fs::read(at("a-0008.csv")).unwrap(), one);

    export(folder.path(), "quick.vtkhdf --to xyz -o a.xyz --frame all").with_code(0);
    let text = fs::read_to_string(at("a.xyz")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 16 * 29);
    let run_file = RunFile::open(&at("quick.vtkhdf")).unwrap();
    for (k, frame) in lines.chunks(29).enumerate() {
        let state = run_file.state(k as u64).unwrap();
        assert_eq!(frame[0], "27");
        assert!(frame[1].ends_with(&format!(" Time={:?}", state.time)), "{}", frame[1]);
        // species, pos, id, radius, velo, angular_velocity
        let last: Vec<&str> = frame[28].split(' ').collect();
        let numbers: Vec<f64> = last[1..].iter().map(|word| word.parse().unwrap()).collect();
        assert_eq!(numbers[..5], [&state.x[26][..], &[26.0, 0.1]].concat());
        assert_eq!(numbers[5..], [state.v[26], state.omega.as_ref().unwrap()[26]].concat());
    }
}

#[test]
fn mistakes_are_told_in_one_line_before_anything_is_written() {
    let folder = quick(&[]);
    fs::write(folder.path().join("there.csv"), "precious").unwrap();
    fs::write(folder.path().join("v.raw.json"), "precious").unwrap();
    fs::write(folder.path().join("c-0003.csv"), "precious").unwrap();
    let refused = |line: &str, parts: &[&str]| {
        export(folder.path(), line).with_code(2).only_error(parts);
    };
    refused("quick.vtkhdf --to csv -o there.csv", &["--output there.csv", "--force"]);
    refused("quick.vtkhdf --to raw -o v.raw", &["--output v.raw.json", "--force"]);
    refused("quick.vtkhdf --to csv -o c.csv --frame all", &["--output c-0003.csv", "--force"]);
    refused("quick.vtkhdf --to csv -o quick.vtkhdf --force", &["--output quick.vtkhdf", "the run itself"]);
    refused("quick.vtkhdf --to csv -o no/a.csv", &["--output no/a.csv", "folder must exist"]);
    refused("quick.vtkhdf --to csv -o a.csv --frame 16", &["--frame 16", "0 to 15"]);
    refused("quick.vtkhdf --to csv -o a.csv --frame first", &["'first'", "last, all or the number"]);
    refused("quick.vtkhdf --to pdf -o a.pdf", &["'pdf'", "csv", "lammps"]);
    refused("quick.vtkhdf --to csv -o a.csv --resolution 5", &["--resolution", "--to raw"]);
    refused("quick.vtkhdf --to raw -o a.raw --resolution 1e6", &["--resolution 1000000", "fewer voxels"]);
    refused("none.vtkhdf --to csv -o a.csv", &["none.vtkhdf", "no such file"]);
    refused("quick.vtkhdf --to csv", &["--output"]);
    for name in ["a.csv", "a.raw", "v.raw", "c-0000.csv"] {
        assert!(!folder.path().join(name).exists(), "{name} was written");
    }
    assert_eq!(fs::read_to_string(folder.path().join("there.csv")).unwrap(), "precious");
    export(folder.path(), "quick.vtkhdf --to csv -o there.csv --force").with_code(0);
    assert!(fs::read_to_string(folder.path().join("there.csv")).unwrap().starts_with("x,y,z"));
}

#[test]
fn a_killed_run_is_exported_up_to_its_last_frame() {
    let folder = TempDir::new().unwrap();
    let scene = format!("{PACKAGE}/configs/quick.toml");
    let sets = ["--set", "t_end=1000", "--set", "output.interval=0.01", "--set", "output.sync=frame"];
    let mut job = Job::alone(folder.path(), &[&scene]).and(&sets).start();
    job.wait_for_frames(20);
    kill(job.process());
    job.end().with_code(137);
    export(folder.path(), "quick.vtkhdf --to csv -o last.csv").with_code(0);
    let run_file = RunFile::open(&folder.path().join("quick.vtkhdf")).unwrap();
    let state = run_file.state(run_file.frames - 1).unwrap();
    let table = fs::read_to_string(folder.path().join("last.csv")).unwrap();
    let row: Vec<f64> = table.lines().last().unwrap().split(',').map(|word| word.parse().unwrap()).collect();
    assert!(!run_file.completed && run_file.frames >= 20);
    assert_eq!(row[..6], [state.x[26], state.v[26]].concat());
}

/// Reads `file`, written by `export`, with `python`; `frame` is that of the run, -1 the last.
#[track_caller]
fn read(python: &Path, folder: &Path, frame: &str, kind: &str, file: &str, more: &[&str]) {
    let arguments = [&["quick.vtkhdf", frame, kind, file], more].concat();
    let said = run_python(python, "read_exports.py", folder, &arguments);
    assert!(said.contains("agrees with frame"), "{said}");
}

#[test]
fn vtk_and_numpy_read_vtp_stl_and_raw_as_the_run_has_them() {
    let Some(python) = python() else { return };
    for more in [&["--set", "friction.coefficient=0.2"], &["--set", "friction.coefficient=0"]] {
        let folder = quick(more);
        let path = folder.path();
        export(path, "quick.vtkhdf --to vtp -o a.vtp").with_code(0);
        read(&python, path, "-1", "vtp", "a.vtp", &[]);
        export(path, "quick.vtkhdf --to vtp -o b.vtp --frame all").with_code(0);
        read(&python, path, "3", "vtp", "b-0003.vtp", &[]);
        export(path, "quick.vtkhdf --to stl -o a.stl").with_code(0);
        read(&python, path, "-1", "stl", "a.stl", &["2"]);
        export(path, "quick.vtkhdf --to stl -o b.stl --subdivisions 3 --frame 0").with_code(0);
        read(&python, path, "0", "stl", "b.stl", &["3"]);
        export(path, "quick.vtkhdf --to raw -o a.raw").with_code(0);
        read(&python, path, "-1", "raw", "a.raw", &[]);
        export(path, "quick.vtkhdf --to raw -o b.raw --resolution 7.3 --ones pore --frame 2").with_code(0);
        read(&python, path, "2", "raw", "b.raw", &[]);
    }
}

/// A folder with sized.vtkhdf: 60 spheres of six radii from 0.01 to 0.1 m and of three species, on a lattice
/// in a box, with spins.
fn sized() -> TempDir {
    let folder = TempDir::new().unwrap();
    let scene = "
t_end = 0.1
gravity = [0.0, 0.0, -9.81]
particles = { density = 2500.0, file = 'start.csv' }
contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 0.4, \
dissipation_focusing = 10.0, interaction_distance = 0.05 }
friction = { coefficient = 0.3, rotation = true, regularization_velocity = 0.01 }
container.box = { min = [0, 0, 0], max = [1, 1, inf] }
output = { interval = 0.05 }
";
    fs::write(folder.path().join("sized.toml"), scene).unwrap();
    let mut table = "x,y,z,vx,vy,vz,avx,avy,avz,radius,species\n".to_owned();
    for k in 0..60 {
        let place = |k: usize| 0.125 + 0.25 * k as f64;
        let (x, y, z) = (place(k % 4), place(k / 4 % 4), place(k / 16));
        let r = [0.1, 0.07, 0.05, 0.03, 0.02, 0.01][(k + k / 6) % 6];
        let name = ["sand", "\"glass, \"\"clear\"\"\"", "coarse gravel"][k % 3];
        table += &format!("{x},{y},{z},0.3,0.1,0,{k},2,3,{r},{name}\n");
    }
    fs::write(folder.path().join("start.csv"), table).unwrap();
    Job::alone(folder.path(), &["sized.toml", "-q"]).run().with_code(0);
    folder
}

#[test]
fn a_bed_of_unequal_spheres_in_csv_starts_the_next_run_with_the_same_sizes_and_species() {
    let folder = sized();
    export(folder.path(), "sized.vtkhdf --to csv -o bed.csv").with_code(0);
    let table = fs::read_to_string(folder.path().join("bed.csv")).unwrap();
    assert_eq!(table.lines().next(), Some("x,y,z,vx,vy,vz,avx,avy,avz,radius,mass,species"));
    let scene = fs::read_to_string(folder.path().join("sized.toml")).unwrap();
    // The masses of the file count, not this density.
    let next = scene.replace("density = 2500.0, file = 'start.csv'", "density = 1.0, file = 'bed.csv'");
    fs::write(folder.path().join("next.toml"), next).unwrap();
    Job::alone(folder.path(), &["next.toml", "-q", "--set", "t_end=0.01"]).run().with_code(0);
    let [old, new] =
        ["sized", "next"].map(|run| RunFile::open(&folder.path().join(run).with_extension("vtkhdf")));
    let (old, new) = (old.unwrap(), new.unwrap());
    let sizes = |run: &RunFile| -> Vec<[u64; 2]> {
        run.sizes.iter().map(|size| [size.r.to_bits(), size.mass.to_bits()]).collect()
    };
    assert_eq!(sizes(&old), sizes(&new));
    assert!(old.sizes.len() == 60 && old.sizes[0].r == 0.1 && old.sizes[0].mass > 10.0);
    assert_eq!(old.species, new.species);
    assert_eq!(old.species.as_ref().unwrap().names, ["sand", "glass, \"clear\"", "coarse gravel"]);
    let end = state(folder.path(), "sized.vtkhdf", Which::Last);
    assert_eq!(bits(&end), bits(&state(folder.path(), "next.vtkhdf", Which::Number(0))));
    // Each run records how heavy its spheres are: by a density, or by their own masses.
    let recorded = |run: &RunFile| (run.scene.particles.radius, run.scene.particles.density);
    let r = recorded(&old).0;
    assert_eq!((recorded(&old), recorded(&new)), ((r, Some(2500.0)), (r, None)));
}

#[test]
fn vtk_and_numpy_read_unequal_spheres_as_the_run_has_them() {
    let Some(python) = python() else { return };
    let folder = sized();
    let path = folder.path();
    let read = |kind: &str, file: &str, more: &[&str]| {
        let arguments = [&["sized.vtkhdf", "-1", kind, file], more].concat();
        let said = run_python(&python, "read_exports.py", path, &arguments);
        assert!(said.contains("agrees with frame"), "{said}");
    };
    export(path, "sized.vtkhdf --to vtp -o a.vtp").with_code(0);
    read("vtp", "a.vtp", &[]);
    export(path, "sized.vtkhdf --to stl -o a.stl").with_code(0);
    read("stl", "a.stl", &["2"]);
    export(path, "sized.vtkhdf --to raw --resolution 4 -o a.raw").with_code(0);
    read("raw", "a.raw", &[]);
}

#[test]
#[cfg(feature = "long-tests")]
fn lammps_and_ovito_read_what_is_written_for_them() {
    let named = |name: &str| std::env::var(name).unwrap_or_else(|_| panic!("{name} is not set"));
    let (lammps, ovito) = (named("LAMMPS"), named("OVITO_PYTHON"));
    for more in [&["--set", "friction.coefficient=0.2"], &["--set", "friction.coefficient=0"]] {
        let folder = quick(more);
        let path = folder.path();
        export(path, "quick.vtkhdf --to lammps -o a.data").with_code(0);
        read(Path::new(&ovito), path, "-1", "lammps", "a.data", &[&lammps]);
        export(path, "quick.vtkhdf --to xyz -o a.xyz --frame all").with_code(0);
        read(Path::new(&ovito), path, "3", "ovito", "a.xyz", &[]);
        read(Path::new(&ovito), path, "-1", "ovito", "a.xyz", &[]);
    }
    let folder = sized();
    export(folder.path(), "sized.vtkhdf --to lammps -o a.data").with_code(0);
    export(folder.path(), "sized.vtkhdf --to xyz -o a.xyz").with_code(0);
    for (kind, file, more) in [("lammps", "a.data", &lammps[..]), ("ovito", "a.xyz", "1")] {
        let arguments = ["sized.vtkhdf", "-1", kind, file, more];
        let said = run_python(Path::new(&ovito), "read_exports.py", folder.path(), &arguments);
        assert!(said.contains("agrees with frame"), "{said}");
    }
}
