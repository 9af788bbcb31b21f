//! Particles as text: CSV, extended XYZ for OVITO, and the data file of LAMMPS.

use std::f64::consts::PI;
use std::io::{self, Write};

use super::{FrameData, vector};

/// Writes columns as `particles.file` of a scene reads them, with rows by id.
pub fn csv(frame: &FrameData, out: &mut dyn Write) -> io::Result<()> {
    let state = frame.state;
    let spins = if state.omega.is_some() { ",avx,avy,avz" } else { "" };
    writeln!(out, "x,y,z,vx,vy,vz{spins}")?;
    for (id, ([x, y, z], v)) in state.x.iter().zip(&state.v).enumerate() {
        write!(out, "{x:?},{y:?},{z:?}")?;
        vector(out, v, ",")?;
        if let Some(omega) = &state.omega {
            vector(out, &omega[id], ",")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Writes one frame of extended XYZ, with the names that OVITO knows. Several frames may follow each other.
pub fn xyz(frame: &FrameData, out: &mut dyn Write) -> io::Result<()> {
    let state = frame.state;
    let (low, high) = frame.cell();
    let [a, b, c] = (high - low).into();
    let spins = if state.omega.is_some() { ":angular_velocity:R:3" } else { "" };
    writeln!(out, "{}", state.x.len())?;
    writeln!(
        out,
        "Lattice=\"{a:?} 0.0 0.0 0.0 {b:?} 0.0 0.0 0.0 {c:?}\" Origin=\"{:?} {:?} {:?}\" pbc=\"F F F\" \
         Properties=species:S:1:pos:R:3:id:I:1:radius:R:1:velo:R:3{spins} Time={:?}",
        low.x, low.y, low.z, state.time
    )?;
    for (id, (x, v)) in state.x.iter().zip(&state.v).enumerate() {
        write!(out, "S")?;
        vector(out, x, " ")?;
        write!(out, " {id} {:?}", frame.radius())?;
        vector(out, v, " ")?;
        if let Some(omega) = &state.omega {
            vector(out, &omega[id], " ")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Writes the data file of LAMMPS for `atom_style sphere` and `units si`. Ids start at 1.
pub fn lammps(frame: &FrameData, out: &mut dyn Write) -> io::Result<()> {
    let (state, r) = (frame.state, frame.radius());
    let (low, high) = frame.cell();
    let density = frame.scene.particles.mass / (4.0 / 3.0 * PI * r * r * r);
    let version = env!("CARGO_PKG_VERSION");
    writeln!(
        out,
        "frame {} at {:?} s by demhybrid {version}, units si, atom_style sphere",
        state.frame, state.time
    )?;
    writeln!(out, "\n{} atoms\n1 atom types\n", state.x.len())?;
    for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
        writeln!(out, "{:?} {:?} {axis}lo {axis}hi", low[k], high[k])?;
    }
    // Id, type, diameter (m), density (kg/m^3), centre (m).
    writeln!(out, "\nAtoms # sphere\n")?;
    for (id, x) in state.x.iter().enumerate() {
        write!(out, "{} 1 {:?} {density:?}", id + 1, 2.0 * r)?;
        vector(out, x, " ")?;
        writeln!(out)?;
    }
    // Id, velocity (m/s), angular velocity (1/s).
    writeln!(out, "\nVelocities\n")?;
    for (id, v) in state.v.iter().enumerate() {
        write!(out, "{}", id + 1)?;
        vector(out, v, " ")?;
        vector(out, &state.omega.as_ref().map_or([0.0; 3], |omega| omega[id]), " ")?;
        writeln!(out)?;
    }
    Ok(())
}
