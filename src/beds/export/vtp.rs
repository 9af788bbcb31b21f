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
         </DataArray>\n</FieldData>\n<Piece NumberOfPoints=\"{n}\" NumberOfVerts=\"{n}\" NumberOfLines=\"0\" \
         NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<PointData Scalars=\"radius\" Vectors=\"velocity\">",
        state.time
    )?;
    integers(out, "id", 0..n)?;
    array(out, "Float64", "radius", 1, |out| (0..n).try_for_each(|_| writeln!(out, "{:?}", frame.radius())))?;
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
