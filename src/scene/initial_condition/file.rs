//! The CSV file of the initial condition: its first line names the columns, each further row is a particle.

use std::fs::File;
use std::io::Read;
use std::os::unix::fs::FileTypeExt;
use std::path::Path;

use csv::StringRecord;

use super::InitialCondition;
use super::header::{renamed, unread};
use super::sizes::{COLUMNS, DENSITY, column};
use crate::error::Error;
use crate::model::columns::{Column, MASS, MATERIAL, SPECIES};
use crate::scene::{Scene, brief, shown};

/// Largest number of rows that a run may read.
const MOST_ROWS: usize = 1_000_000_000;

/// Largest number of species, and of materials.
const MOST_SPECIES: usize = 1000;

/// The three columns of a vector. They must be given together.
pub(super) struct Triple {
    pub names: [&'static str; 3],
    pub name: &'static str,
    pub unit: &'static str,
}

pub(super) const CENTRE: Triple = Triple { names: ["x", "y", "z"], name: "centre", unit: "m" };
pub(super) const VELOCITY: Triple = Triple { names: ["vx", "vy", "vz"], name: "velocity", unit: "m/s" };
pub(super) const SPIN: Triple =
    Triple { names: ["avx", "avy", "avz"], name: "angular velocity", unit: "rad/s" };

/// Part of messages: why angular velocities are refused, and what to do.
pub(super) const NO_ROTATION: &str = "this scene has no rotation: spins must be 0 or left out, or rotation \
                                      switched on by [friction] with a coefficient > 0 and rotation = true";

/// Reads the file that `particles.file` names. To be called on rank 0 only.
///
/// A relative path starts at `scene_folder`. The order of the rows gives the ids. All values of the result
/// are finite; [`super::check`] checks them against the walls. Columns of sizes are as the file has them.
pub fn read_csv(scene: &Scene, scene_folder: &Path) -> Result<InitialCondition, Error> {
    let Some(file) = &scene.particles.file else {
        return Err(Error::Input("particles.file is missing: there is no CSV file to read".to_owned()));
    };
    let mut start = read_table(file, scene_folder, scene.rotates())?;
    start.settle_materials(scene)?;
    Ok(start)
}

/// `read_csv` for the `file` of a scene that may have rotation.
pub(crate) fn read_table(file: &Path, scene_folder: &Path, rotates: bool) -> Result<InitialCondition, Error> {
    let path = scene_folder.join(file);
    let name = shown(&path);
    let bytes = read_bytes(&path).map_err(|why| {
        Error::Input(format!(
            "{name}: cannot read the file that particles.file names: {why}: it must be a CSV file, and a \
             relative path starts at the folder of the scene"
        ))
    })?;
    let text = text_of(bytes).map_err(|(line, why)| {
        Error::Input(format!("{name}:{line}: {why}: the file must be a CSV table with the columns x,y,z"))
    })?;
    Table { name: &name, text: &text, rotates }.read()
}

/// Bytes as text, without a byte order mark. An error gives the line, from 1, and says what it is instead.
pub(crate) fn text_of(bytes: Vec<u8>) -> Result<String, (usize, &'static str)> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err((1, "UTF-16 text, and UTF-8 is expected"));
    }
    let line_at = |bytes: &[u8], end: usize| 1 + bytes[..end].iter().filter(|&&byte| byte == b'\n').count();
    if let Some(zero) = bytes.iter().position(|&byte| byte == 0) {
        return Err((line_at(&bytes, zero), "no text, as it holds a byte 0"));
    }
    let text = String::from_utf8(bytes).map_err(|mistake| {
        (line_at(mistake.as_bytes(), mistake.utf8_error().valid_up_to()), "not UTF-8 text")
    })?;
    Ok(match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_owned(),
        None => text,
    })
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
        let mut options = csv::ReaderBuilder::new();
        let options = options.flexible(true).has_headers(false).comment(Some(b'#'));
        let mut reader = options.from_reader(self.text.as_bytes());
        let mut row = StringRecord::new();
        if !self.next(&mut reader, &mut row)? {
            let empty =
                if self.text.contains('#') { "there is nothing but comments" } else { "the file is empty" };
            let message = format!("{empty}: its first line must name the columns, e.g. x,y,z");
            return Err(Error::Input(format!("{}: {message}", self.name)));
        }
        let header: Vec<String> = row.iter().map(|name| name.trim().to_owned()).collect();
        let header_line = self.line(&row);
        let centre = self
            .columns(&header, header_line, &CENTRE)?
            .ok_or_else(|| self.no_centres(&header, header_line))?;
        let velocity = self.columns(&header, header_line, &VELOCITY)?;
        let spin = self.columns(&header, header_line, &SPIN)?;
        let mut start = InitialCondition { unread: unread(&header), ..InitialCondition::default() };
        let sizes = self.size_columns(&header, header_line)?;
        start.columns.extend(sizes.iter().map(|(name, unit, _)| (column(name, unit), Vec::new())));
        let species = self.column_of(&header, header_line, SPECIES)?;
        let (mut names, mut numbers) = (Vec::<String>::new(), Vec::new());
        let material = self.column_of(&header, header_line, MATERIAL)?;
        // What is blank has no material.
        let mut materials = (vec![String::new()], Vec::new());
        while self.next(&mut reader, &mut row)? {
            // Skip a line of blanks.
            if header.len() > 1 && row.len() == 1 && row[0].trim().is_empty() {
                continue;
            }
            if row.len() != header.len() {
                let quoted = row.iter().any(|field| field.contains([',', '\n']));
                let hint = match row.len() > header.len() {
                    true => ": commas separate fields, decimals follow a point",
                    false if quoted => ": every row needs all of them, and a quotation mark joins fields",
                    false => ": every row needs all of them",
                };
                let fields = if row.len() == 1 { "field" } else { "fields" };
                let message = format!(
                    "the row has {} {fields}, but the first line names {} columns ({}){hint}",
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
            for ((name, unit, place), (_, numbers)) in sizes.iter().zip(&mut start.columns) {
                numbers.push(self.size(&row, *place, name, unit)?);
            }
            if let Some(place) = species {
                numbers.push(self.name(&row, place, SPECIES, &mut names)? as f64);
            }
            if let Some(place) = material {
                materials.1.push(self.name(&row, place, MATERIAL, &mut materials.0)? as f64);
            }
        }
        if start.x.is_empty() {
            return Err(Error::Input(format!(
                "{}: no particles: there must be a row for each below the first line, which names the \
                 columns",
                self.name
            )));
        }
        if species.is_some() {
            start.columns.push((Column { names, ..column(SPECIES, "1") }, numbers));
        }
        if material.is_some() {
            let (names, numbers) = materials;
            start.columns.push((Column { names, ..column(MATERIAL, "1") }, numbers));
        }
        Ok(start)
    }

    /// The number of the column `name`, from 0, if there is one.
    fn column_of(&self, header: &[String], line: usize, name: &str) -> Result<Option<usize>, Error> {
        let mut named = header.iter().enumerate().filter(|(_, other)| *other == name);
        let first = named.next().map(|(place, _)| place);
        if named.next().is_some() {
            let message = format!("column {name} is named twice: each name may stand there once");
            return Err(Error::Input(format!("{}:{line}: {message}", self.name)));
        }
        Ok(first)
    }

    /// The index in `names` of the species or the material of a row: `what` its column is. A new name is
    /// added.
    fn name(
        &self,
        row: &StringRecord,
        place: usize,
        what: &str,
        names: &mut Vec<String>,
    ) -> Result<usize, Error> {
        let name = row[place].trim();
        if let Some(index) = names.iter().position(|other| other == name) {
            return Ok(index);
        }
        if name.is_empty() || name.contains('\n') || names.len() == MOST_SPECIES {
            let message = format!(
                "{what} = \"{}\": column {what} needs a name on one line, and {MOST_SPECIES} names at most in \
                 all",
                brief(name)
            );
            return Err(self.wrong(row, &message));
        }
        names.push(name.to_owned());
        Ok(names.len() - 1)
    }

    fn next(&self, reader: &mut csv::Reader<&[u8]>, row: &mut StringRecord) -> Result<bool, Error> {
        let read = reader.read_record(row);
        read.map_err(|why| Error::Input(format!("{}: not a CSV table: {why}", self.name)))
    }

    /// The columns of sizes: name, unit and number, from 0.
    fn size_columns(
        &self,
        header: &[String],
        line: usize,
    ) -> Result<Vec<(&'static str, &'static str, usize)>, Error> {
        let mut found = Vec::new();
        for (name, unit) in COLUMNS {
            found.extend(self.column_of(header, line, name)?.map(|place| (name, unit, place)));
        }
        let names: Vec<&str> = found.iter().map(|(name, ..)| *name).collect();
        if names.contains(&MASS) && names.contains(&DENSITY) {
            let message = "columns mass and density contradict each other: one of them says how heavy a \
                           sphere is";
            return Err(Error::Input(format!("{}:{line}: {message}", self.name)));
        }
        Ok(found)
    }

    /// A radius, a mass or a density.
    fn size(&self, row: &StringRecord, place: usize, name: &str, unit: &str) -> Result<f64, Error> {
        let field = row[place].trim();
        let number = field.parse::<f64>().unwrap_or(f64::NAN);
        if number.is_normal() && number > 0.0 {
            return Ok(number);
        }
        let message =
            format!("{name} = \"{}\": column {name} needs a number greater than 0, in {unit}", brief(field));
        Err(self.wrong(row, &message))
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
        let absent: Vec<&str> = absent.into_iter().map(|(_, name)| name).collect();
        let hint = match renamed(header, &absent) {
            hint if hint.is_empty() => hint,
            hint => format!("; {hint}"),
        };
        let message = format!(
            "column {} is missing: {} go together, they are the {} in {}; the first line is {}{hint}",
            absent[0],
            triple.names.join(","),
            triple.name,
            triple.unit,
            brief(&header.join(","))
        );
        Err(Error::Input(format!("{}:{line}: {message}", self.name)))
    }

    fn no_centres(&self, header: &[String], line: usize) -> Error {
        let first = header.join(",");
        let names = renamed(header, &CENTRE.names);
        let words: Vec<&str> = first.split([';', '\t', ' ', '|']).filter(|word| !word.is_empty()).collect();
        let separated_otherwise = header.len() == 1
            && words.len() >= 3
            && (words.contains(&"x")
                || words.iter().all(|word| word.replace(',', ".").parse::<f64>().is_ok()));
        let hint = if separated_otherwise {
            "; fields must be separated by commas, and decimals follow a point".to_owned()
        } else if self.names_stand_in_a_comment() {
            "; the names stand behind #, which makes a line a comment".to_owned()
        } else if header.len() > 1 && header.iter().all(|name| name.parse::<f64>().is_ok()) {
            "; numbers start below it".to_owned()
        } else if !names.is_empty() {
            format!("; {names}")
        } else {
            String::new()
        };
        let message = format!(
            "columns x, y and z are missing: the first line must name them, they are the centre in m; it is \
             {}{hint}",
            brief(&first)
        );
        Error::Input(format!("{}:{line}: {message}", self.name))
    }

    /// Whether a comment holds the names of the columns, as some programs write them.
    fn names_stand_in_a_comment(&self) -> bool {
        let names = |line: &str| {
            let fields: Vec<&str> = line.trim_start_matches('#').split(',').map(str::trim).collect();
            CENTRE.names.iter().all(|name| fields.contains(name))
        };
        self.text.lines().take_while(|line| line.starts_with('#')).any(names)
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
            let first_word = field.split_whitespace().next().unwrap_or_default();
            let hint = match field {
                _ if field.contains(',') => "; decimals follow a point, and nothing parts thousands",
                _ if field.contains('#') => "; a comment needs a line of its own",
                _ if first_word.parse::<f64>().is_ok() && first_word != field => {
                    "; it must stand without a unit"
                }
                _ => "",
            };
            let message = format!(
                "{name} = \"{}\" {problem}: column {name} needs a finite number, a part of the {} in \
                 {}{hint}",
                brief(field),
                triple.name,
                triple.unit
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

    /// Number of the line of a row, from 1. The count of the CSV reader is wrong after blank lines, carriage
    /// returns and comments.
    fn line(&self, row: &StringRecord) -> usize {
        let start = row.position().map_or(0, |position| position.byte() as usize);
        let before = &self.text.as_bytes()[..start];
        let skipped = |line: &&str| line.starts_with('#') || line.trim_end_matches(['\r', '\n']).is_empty();
        // The reader may stop between the carriage return and the end of a line.
        let skipped =
            self.text[start..].split_inclusive('\n').take_while(skipped).filter(|line| line.ends_with('\n'));
        1 + before.iter().filter(|&&byte| byte == b'\n').count() + skipped.count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<InitialCondition, Error> {
        Table { name: "a.csv", text, rotates: true }.read()
    }

    #[test]
    fn columns_are_found_by_name_and_others_are_told() {
        let start = read("id, z ,y,x,colour,avx,avy,avz\r\n9,3,2,1,red,4,5,6\r\n").unwrap();
        assert_eq!(
            start,
            InitialCondition {
                x: vec![[1.0, 2.0, 3.0]],
                v: vec![[0.0; 3]],
                omega: vec![[4.0, 5.0, 6.0]],
                unread: start.unread.clone(),
                ..InitialCondition::default()
            }
        );
        assert_eq!(start.unread, ["id (the order of rows gives ids)", "colour"]);
        let start = read("\n x,y,z,vx,vy,vz\n\n\"1\", 2 ,3e0,+4,5.,.5\n   \n").unwrap();
        assert_eq!((start.x[0], start.v[0]), ([1.0, 2.0, 3.0], [4.0, 5.0, 0.5]));
    }

    #[test]
    fn lines_that_begin_with_a_hash_are_comments() {
        let text = "# from a spreadsheet\n#\r\nx,y,z\n1,2,3\n# half way\n4,5,6\n";
        assert_eq!(read(text).unwrap().x, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
        let message = read("# a\n\n# b\nx,y,z\n# c\n1,2,3\n# d\n1,b,3\n").unwrap_err().to_string();
        assert!(message.starts_with("a.csv:8: y = \"b\" is not a number"), "{message}");
        let message = read("# x,y,z\n1,2,3\n").unwrap_err().to_string();
        assert!(
            message.starts_with("a.csv:2: ") && message.contains("the names stand behind #"),
            "{message}"
        );
    }

    #[test]
    fn columns_of_other_programs_are_refused_with_the_names_that_are_read() {
        let message = read("\"Points:0\",\"Points:1\",\"Points:2\"\n1,2,3\n").unwrap_err().to_string();
        assert!(message.contains("\"Points:0\" must be named x, \"Points:1\" must be named y"), "{message}");
        let message = read("x [m],y [m],z [m]\n1,2,3\n").unwrap_err().to_string();
        assert!(message.contains("\"z [m]\" must be named z"), "{message}");
        let message = read("x,y,z,vx,vel_y,vz\n1,2,3,4,5,6\n").unwrap_err().to_string();
        assert!(message.contains("column vy is missing") && message.ends_with("\"vel_y\" must be named vy"));
    }

    #[test]
    fn bytes_that_are_no_text_are_told_by_their_kind() {
        assert_eq!(text_of(b"\xef\xbb\xbfx,y".to_vec()), Ok("x,y".to_owned()));
        assert_eq!(text_of(b"\xff\xfex\0".to_vec()).unwrap_err().0, 1);
        assert_eq!(text_of(b"x\ny\0".to_vec()), Err((2, "no text, as it holds a byte 0")));
        assert_eq!(text_of(b"x\n\n\xe9".to_vec()), Err((3, "not UTF-8 text")));
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
