//! VTK XML PolyData: points with their arrays, as text. It needs no library and keeps all digits.

use std::io::{self, Write};

use super::{FrameData, vector};

/// Writes the frame. The field `TimeValue` tells ParaView its time.
pub fn write(frame: &FrameData, out: &mut dyn Write) -> io::Result<()> {
    let state = frame.state;
    let n = state.x.len();
    writeln!(
        out,
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\">\n<PolyData>\n\
         <FieldData>\n\
         <DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">{:?}\
         </DataArray>",
        state.time
    )?;
    if let Some(species) = frame.species {
        names(out, "species_names", &species.names)?;
    }
    if !state.materials.is_empty() {
        let all: Vec<String> =
            (0..=frame.scene.material.len()).map(|k| frame.scene.material_name(k).to_owned()).collect();
        names(out, "material_names", &all)?;
    }
    writeln!(
        out,
        "</FieldData>\n<Piece NumberOfPoints=\"{n}\" NumberOfVerts=\"{n}\" NumberOfLines=\"0\" \
         NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<PointData Scalars=\"radius\" Vectors=\"velocity\">"
    )?;
    integers(out, "id", 0..n)?;
    let sizes = frame.sizes();
    numbers(out, "radius", (0..n).map(|k| sizes.of(k).r))?;
    if frame.is_sized() {
        numbers(out, "mass", (0..n).map(|k| sizes.of(k).mass))?;
    }
    if let Some(species) = frame.species {
        numbers(out, "species", species.of.iter().map(|&index| f64::from(index)))?;
    }
    if !state.materials.is_empty() {
        numbers(out, "material", state.materials.iter().map(|&index| f64::from(index)))?;
    }
    vectors(out, "velocity", &state.v)?;
    if let Some(omega) = &state.omega {
        vectors(out, "angular_velocity", omega)?;
    }
    writeln!(out, "</PointData>\n<Points>")?;
    vectors(out, "Points", &state.x)?;
    writeln!(out, "</Points>\n<Verts>")?;
    integers(out, "connectivity", 0..n)?;
    integers(out, "offsets", 1..n + 1)?;
    writeln!(out, "</Verts>\n</Piece>\n</PolyData>\n</VTKFile>")
}

/// Writes the names of species or materials 0, 1, ... as a field: bytes of text, each name ended by 0.
fn names(out: &mut dyn Write, field: &str, names: &[String]) -> io::Result<()> {
    writeln!(
        out,
        "<Array type=\"String\" Name=\"{field}\" NumberOfTuples=\"{}\" format=\"ascii\">",
        names.len()
    )?;
    for name in names {
        name.bytes().try_for_each(|byte| write!(out, "{byte} "))?;
        writeln!(out, "0")?;
    }
    writeln!(out, "</Array>")
}

fn numbers(out: &mut dyn Write, name: &str, numbers: impl Iterator<Item = f64>) -> io::Result<()> {
    array(out, "Float64", name, 1, |out| {
        let mut numbers = numbers;
        numbers.try_for_each(|number| writeln!(out, "{number:?}"))
    })
}

fn integers(out: &mut dyn Write, name: &str, numbers: std::ops::Range<usize>) -> io::Result<()> {
    array(out, "Int64", name, 1, |out| numbers.into_iter().try_for_each(|k| writeln!(out, "{k}")))
}

fn vectors(out: &mut dyn Write, name: &str, rows: &[[f64; 3]]) -> io::Result<()> {
    array(out, "Float64", name, 3, |out| {
        rows.iter().try_for_each(|row| {
            vector(out, row, " ")?;
            writeln!(out)
        })
    })
}

fn array(
    out: &mut dyn Write,
    kind: &str,
    name: &str,
    components: usize,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    writeln!(
        out,
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"ascii\">"
    )?;
    content(out)?;
    writeln!(out, "</DataArray>")
}
