//! The CSV file of the initial condition: its first line names the columns, each further row is a particle.

use std::fs::File;
use std::io::Read;
use std::os::unix::fs::FileTypeExt;
use std::path::Path;

use csv::StringRecord;

use super::{InitialCondition, NO_ROTATION};
use crate::error::Error;
use crate::scene::{Scene, brief, shown};

/// Largest number of rows that a run may read.
const MOST_ROWS: usize = 1_000_000_000;

/// The three columns of a vector. They must be given together.
struct Triple {
    names: [&'static str; 3],
    meaning: &'static str,
}

const CENTRE: Triple = Triple { names: ["x", "y", "z"], meaning: "the centre in m" };
const VELOCITY: Triple = Triple { names: ["vx", "vy", "vz"], meaning: "the velocity in m/s" };
const SPIN: Triple = Triple { names: ["avx", "avy", "avz"], meaning: "the angular velocity in 1/s" };

/// Reads the file that `particles.file` names. To be called on rank 0 only.
///
/// A relative path starts at `scene_folder`. The order of the rows gives the ids. All values of the result
/// are finite; [`super::check`] checks them against the walls.
pub fn read_csv(scene: &Scene, scene_folder: &Path) -> Result<InitialCondition, Error> {
    let Some(file) = &scene.particles.file else {
        return Err(Error::Input("particles.file is missing: there is no CSV file to read".to_owned()));
    };
    let path = scene_folder.join(file);
    let name = shown(&path);
    let bytes = read_bytes(&path).map_err(|why| {
        Error::Input(format!(
            "{name}: cannot read the file that particles.file names: {why}: it must be a CSV file, and a \
             relative path starts at the folder of the scene"
        ))
    })?;
    let text = String::from_utf8(bytes).map_err(|mistake| {
        let sound = &mistake.as_bytes()[..mistake.utf8_error().valid_up_to()];
        let line = 1 + sound.iter().filter(|&&byte| byte == b'\n').count();
        Error::Input(format!(
            "{name}:{line}: not UTF-8 text: the file must be a CSV table with the columns x,y,z"
        ))
    })?;
    // Some spreadsheets write a byte order mark.
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    Table { name: &name, text, rotates: scene.rotates() }.read()
}

/// The content of a file or a pipe. A device is refused, since it may be endless.
pub(crate) fn read_bytes(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    let kind = file.metadata()?.file_type();
    if kind.is_char_device() || kind.is_block_device() {
        return Err(std::io::Error::other("it is a device"));
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// A CSV text, with its name for messages, and whether the scene has rotation.
struct Table<'a> {
    name: &'a str,
    text: &'a str,
    rotates: bool,
}

impl Table<'_> {
    fn read(&self) -> Result<InitialCondition, Error> {
        let mut reader =
            csv::ReaderBuilder::new().flexible(true).has_headers(false).from_reader(self.text.as_bytes());
        let mut row = StringRecord::new();
        if !self.next(&mut reader, &mut row)? {
            let message = "the file is empty: its first line must name the columns, e.g. x,y,z";
            return Err(Error::Input(format!("{}: {message}", self.name)));
        }
        let header: Vec<String> = row.iter().map(|name| name.trim().to_owned()).collect();
        let header_line = self.line(&row);
        let centre = self
            .columns(&header, header_line, &CENTRE)?
            .ok_or_else(|| self.no_centres(&header, header_line))?;
        let velocity = self.columns(&header, header_line, &VELOCITY)?;
        let spin = self.columns(&header, header_line, &SPIN)?;
        let mut start = InitialCondition::default();
        while self.next(&mut reader, &mut row)? {
            // Skip a line of blanks.
            if header.len() > 1 && row.len() == 1 && row[0].trim().is_empty() {
                continue;
            }
            if row.len() != header.len() {
                let hint = match row.len() > header.len() {
                    true => ": commas separate fields, decimals follow a point",
                    false => ": every row needs all of them",
                };
                let message = format!(
                    "the row has {} fields, but the first line names {} columns ({}){hint}",
                    row.len(),
                    header.len(),
                    brief(&header.join(","))
                );
                return Err(self.wrong(&row, &message));
            }
            if start.x.len() == MOST_ROWS {
                return Err(
                    self.wrong(&row, &format!("more than {MOST_ROWS} rows, the most particles of a run"))
                );
            }
            start.x.push(self.vector(&row, Some(centre), &CENTRE)?);
            start.v.push(self.vector(&row, velocity, &VELOCITY)?);
            start.omega.push(self.spin(&row, spin)?);
        }
        if start.x.is_empty() {
            return Err(Error::Input(format!(
                "{}: no particles: there must be a row for each below the first line, which names the \
                 columns",
                self.name
            )));
        }
        Ok(start)
    }

    fn next(&self, reader: &mut csv::Reader<&[u8]>, row: &mut StringRecord) -> Result<bool, Error> {
        let read = reader.read_record(row);
        read.map_err(|why| Error::Input(format!("{}: not a CSV table: {why}", self.name)))
    }

    /// Numbers of the columns of a vector, from 0; `None` if all three are absent.
    fn columns(&self, header: &[String], line: usize, triple: &Triple) -> Result<Option<[usize; 3]>, Error> {
        let mut columns = [None; 3];
        for (column, name) in columns.iter_mut().zip(triple.names) {
            let mut named = header.iter().enumerate().filter(|(_, other)| *other == name);
            *column = named.next().map(|(number, _)| number);
            if named.next().is_some() {
                let message = format!(
                    "column {name} is named twice; the first line is {}: each name may stand there once",
                    brief(&header.join(","))
                );
                return Err(Error::Input(format!("{}:{line}: {message}", self.name)));
            }
        }
        if let [Some(a), Some(b), Some(c)] = columns {
            return Ok(Some([a, b, c]));
        }
        let absent: Vec<_> =
            columns.iter().zip(triple.names).filter(|(column, _)| column.is_none()).collect();
        if absent.len() == 3 {
            return Ok(None);
        }
        let message = format!(
            "column {} is missing: {} go together, they are {}; the first line is {}",
            absent[0].1,
            triple.names.join(","),
            triple.meaning,
            brief(&header.join(","))
        );
        Err(Error::Input(format!("{}:{line}: {message}", self.name)))
    }

    fn no_centres(&self, header: &[String], line: usize) -> Error {
        let first = header.join(",");
        let hint = if first.contains([';', '\t']) {
            "; fields must be separated by commas"
        } else if header.iter().all(|name| name.parse::<f64>().is_ok()) {
            "; numbers start below it"
        } else if header.iter().any(|name| ["X", "Y", "Z"].contains(&name.as_str())) {
            "; names are in lower case"
        } else {
            ""
        };
        let message = format!(
            "columns x, y and z are missing: the first line must name them, they are the centre in m; it is \
             {}{hint}",
            brief(&first)
        );
        Error::Input(format!("{}:{line}: {message}", self.name))
    }

    fn vector(
        &self,
        row: &StringRecord,
        columns: Option<[usize; 3]>,
        triple: &Triple,
    ) -> Result<[f64; 3], Error> {
        let Some(columns) = columns else { return Ok([0.0; 3]) };
        let mut vector = [0.0; 3];
        for ((number, column), name) in vector.iter_mut().zip(columns).zip(triple.names) {
            let field = row[column].trim();
            let problem = match field.parse::<f64>() {
                Ok(finite) if finite.is_finite() => {
                    *number = finite;
                    continue;
                }
                Ok(_) => "is not finite",
                Err(_) => "is not a number",
            };
            let message = format!(
                "{name} = \"{}\" {problem}: column {name} needs a finite number, a part of {}",
                brief(field),
                triple.meaning
            );
            return Err(self.wrong(row, &message));
        }
        Ok(vector)
    }

    /// The angular velocity of a row, rad/s. It must be 0 if the scene has no rotation.
    fn spin(&self, row: &StringRecord, columns: Option<[usize; 3]>) -> Result<[f64; 3], Error> {
        let spin = self.vector(row, columns, &SPIN)?;
        if !self.rotates {
            for (value, name) in spin.iter().zip(SPIN.names) {
                if *value != 0.0 {
                    return Err(self.wrong(row, &format!("{name} = {value}, but {NO_ROTATION}")));
                }
            }
        }
        Ok(spin)
    }

    fn wrong(&self, row: &StringRecord, message: &str) -> Error {
        Error::Input(format!("{}:{}: {message}", self.name, self.line(row)))
    }

    /// Number of the line of a row, from 1. The count of the CSV reader is wrong after blank lines and
    /// carriage returns.
    fn line(&self, row: &StringRecord) -> usize {
        let start = row.position().map_or(0, |position| position.byte() as usize);
        let bytes = self.text.as_bytes();
        let blank = bytes[start..].iter().take_while(|&&byte| byte == b'\n' || byte == b'\r').count();
        1 + bytes[..start + blank].iter().filter(|&&byte| byte == b'\n').count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<InitialCondition, Error> {
        Table { name: "a.csv", text, rotates: true }.read()
    }

    #[test]
    fn columns_are_found_by_name_and_others_are_ignored() {
        let start = read("id, z ,y,x,colour,avx,avy,avz\r\n9,3,2,1,red,4,5,6\r\n").unwrap();
        assert_eq!(
            start,
            InitialCondition {
                x: vec![[1.0, 2.0, 3.0]],
                v: vec![[0.0; 3]],
                omega: vec![[4.0, 5.0, 6.0]],
                ..InitialCondition::default()
            }
        );
        let start = read("\n x,y,z,vx,vy,vz\n\n\"1\", 2 ,3e0,+4,5.,.5\n   \n").unwrap();
        assert_eq!((start.x[0], start.v[0]), ([1.0, 2.0, 3.0], [4.0, 5.0, 0.5]));
    }

    #[test]
    fn a_number_keeps_all_its_digits() {
        assert_eq!(read("x,y,z\n0.30000000000000004,5e-324,-0\n").unwrap().x[0], [0.1 + 0.2, 5e-324, -0.0]);
    }

    #[test]
    fn the_line_of_a_mistake_counts_blank_lines_and_carriage_returns() {
        for text in ["x,y,z\n1,2,3\n\n\n1,b,3\n", "x,y,z\r\n\r\n1,2,3\r\n\r\n1,b,3", "\n\nx,y,z\n\n1,b,3"] {
            let message = read(text).unwrap_err().to_string();
            assert!(message.starts_with("a.csv:5: y = \"b\" is not a number"), "{message}");
        }
    }
}
