//! What is in the output file of a run?
//!
//! `cargo run --example read_run_file -- settle.vtkhdf` reads that file. Without a path the program makes a
//! small file first: a sphere rests on another one, in a narrow shaft.

use demhybrid::beds::measures::contacts::{Contacts, Partner, SHARE};
use demhybrid::cli::{Args, run};
use demhybrid::domain::Solo;
use demhybrid::error::Error;
use demhybrid::files::names::Series;
use demhybrid::files::run_file::{RunFile, Which};
use std::path::{Path, PathBuf};

const SCENE: &str = "
    t_end = 2.0
    gravity = [0.0, 0.0, -9.81]
    particles = { radius = 0.1, mass = 1, grid = { count = 2, spacing = 0.21, jitter = 0.0, bottom = 0.0 } }
    container.box = { max = [0.21, 0.21, inf] }
    contact = { repulsion_at_contact = 10.0, stiffness_exponent = 150.0, restitution = 0.4,
                dissipation_focusing = 10.0, interaction_distance = 0.1 }
    output.interval = 0.5
";

/// Makes an output file in `folder`, as the command `demhybrid shaft.toml --output shaft.vtkhdf --quiet`.
fn example_file(folder: &Path) -> Result<PathBuf, Error> {
    let (scene, output) = (folder.join("shaft.toml"), folder.join("shaft.vtkhdf"));
    std::fs::write(&scene, SCENE).map_err(|why| Error::Input(why.to_string()))?;
    let args = Args {
        scene: Some(scene),
        output: Some(output.clone()),
        threads: Some(1),
        quiet: true,
        ..Args::default()
    };
    run::run(&args, &Solo)?;
    Ok(output)
}

fn main() -> Result<(), Error> {
    let folder = tempfile::tempdir().map_err(|why| Error::Input(why.to_string()))?;
    let given = std::env::args_os().nth(1).map(PathBuf::from);
    let path = given.map_or_else(|| example_file(folder.path()), Ok)?;

    let file = RunFile::open(&path)?;
    println!("{} spheres of radius {} m, {} frames", file.count, file.scene.particles.radius, file.frames);
    let energies = file.series(Series::KineticEnergy)?;
    for k in file.numbers(Which::All)? {
        let (state, energy) = (file.state(k)?, energies[k as usize]);
        println!("frame {k} at {} s: {energy:.2e} J, sphere 0 at {:.4?} m", state.time, state.x[0]);
    }
    let last = file.state(file.frames - 1)?;
    let contacts = Contacts::of(&file.scene, &last, SHARE);
    println!("{} contacts of more than {} N in the last frame", contacts.pushing.len(), contacts.threshold);
    for contact in contacts.pushing.iter().take(10) {
        let partner = match contact.partner {
            Partner::Sphere(j) => format!("sphere {j}"),
            Partner::Wall(k) => contacts.walls[k].wall.clone(),
        };
        println!("sphere {} and {partner}: {:.2e} m, {:.2} N", contact.i, contact.overlap, contact.force);
    }
    assert_eq!((file.frames, last.x.len() as u64), (energies.len() as u64, file.count));
    Ok(())
}
