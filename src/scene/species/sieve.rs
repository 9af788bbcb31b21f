//! The CSV file of a sieve curve: radii or diameters, each with the share of the mass below it.

use std::path::Path;

use crate::error::Error;
use crate::scene::initial_condition::{read_bytes, text_of};
use crate::scene::{brief, shown};

/// Most rows of a sieve curve: each stands in the recorded scene.
const MOST_ROWS: usize = 10_000;

/// What would be right, for messages.
const FORM: &str = "its first line must be radius,share or diameter,share (m, and the share of the mass \
                    below it), and the shares of the rows must rise from 0 to 1";

/// The text of the table `file` of a scene in `folder`. To be called on rank 0 only.
pub(crate) fn read(file: &Path, folder: &Path) -> Result<String, Error> {
    let path = folder.join(file);
    let bytes = read_bytes(&path).map_err(|why| {
        Error::Input(format!(
            "{}: cannot read the sieve curve that species.radius.table names: {why}: it must be a CSV file, \
             and a relative path starts at the folder of the scene",
            shown(&path)
        ))
    })?;
    text_of(bytes).map_err(|(line, why)| Error::Input(format!("{}:{line}: {why}: {FORM}", shown(&path))))
}

/// The points of a curve: radii (m) with shares. `name` is that of the file, for messages.
pub(super) fn points(name: &str, text: &str) -> Result<Vec<[f64; 2]>, Error> {
    let wrong = |line: usize, why: &str| Err(Error::Input(format!("{name}:{line}: {why}: {FORM}")));
    let rows = text.lines().enumerate().map(|(k, line)| (k + 1, line.trim()));
    let mut rows = rows.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let Some((line, header)) = rows.next() else {
        return Err(Error::Input(format!("{name}: there is no row in it: {FORM}")));
    };
    let names: Vec<&str> = header.split(',').map(|name| name.trim().trim_matches('"')).collect();
    let place = |name: &str| names.iter().position(|other| *other == name);
    let twice = |name: &str| names.iter().filter(|other| **other == name).count() > 1;
    let (sizes, per_radius) = match (place("radius"), place("diameter")) {
        (Some(radii), None) => (radii, 1.0),
        (None, Some(diameters)) => (diameters, 0.5),
        (Some(_), Some(_)) => return wrong(line, "it has a column radius and a column diameter"),
        (None, None) => return wrong(line, &format!("it begins with {}", brief(header))),
    };
    let Some(shares) = place("share") else {
        return wrong(line, &format!("there is no column share in {}", brief(header)));
    };
    if let Some(name) = ["radius", "diameter", "share"].into_iter().find(|name| twice(name)) {
        return wrong(line, &format!("column {name} is named twice"));
    }
    let mut points: Vec<[f64; 2]> = Vec::new();
    for (line, row) in rows {
        let fields: Vec<&str> = row.split(',').map(str::trim).collect();
        if fields.len() != names.len() {
            let (found, expected) = (fields.len(), names.len());
            return wrong(line, &format!("the row has {found} fields, and the first line names {expected}"));
        }
        if points.len() == MOST_ROWS {
            return wrong(line, &format!("more than {MOST_ROWS} rows"));
        }
        let mut point = [0.0; 2];
        for (number, place) in point.iter_mut().zip([sizes, shares]) {
            let field = fields[place].trim_matches('"');
            match field.parse::<f64>() {
                Ok(finite) if finite.is_finite() => *number = finite,
                _ => {
                    let (name, field) = (names[place], brief(field));
                    return wrong(line, &format!("{name} = \"{field}\" is no finite number"));
                }
            }
        }
        if let Err(why) = follows(points.last(), point, [names[sizes], "share"]) {
            return wrong(line, &why);
        }
        points.push(point);
    }
    let last = points.last().map_or(0.0, |point| point[1]);
    if points.len() < 2 || (last - 1.0).abs() > 1e-6 {
        let why = format!("share = {last} in the last row");
        let end = text.lines().count().max(1);
        return wrong(end, if points.len() < 2 { "there are less than two rows" } else { &why });
    }
    Ok(in_radii(&points, per_radius))
}

/// `points` with sizes times `per_radius`, and shares that end with 1.
pub(super) fn in_radii(points: &[[f64; 2]], per_radius: f64) -> Vec<[f64; 2]> {
    let last = points.last().map_or(1.0, |point| point[1]);
    points.iter().map(|[size, share]| [size * per_radius, share / last]).collect()
}

/// Why a `point` cannot come after `before`; `names` are those of its two numbers.
pub(super) fn follows(before: Option<&[f64; 2]>, point: [f64; 2], names: [&str; 2]) -> Result<(), String> {
    let ([size, share], [name, other]) = (point, names);
    if !size.is_normal() || size <= 0.0 {
        return Err(format!("{name} = {size} is not above 0"));
    }
    if !(0.0..=1.0 + 1e-6).contains(&share) {
        return Err(format!("{other} = {share} is outside 0..1"));
    }
    match before {
        None if share != 0.0 => Err(format!("{other} = {share} in the first row")),
        Some([last, _]) if size <= *last => {
            Err(format!("{name} = {size} does not rise: {last} stands before it"))
        }
        Some([_, last]) if share < *last => Err(format!("{other} = {share} falls: {last} stands before it")),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_read_by_the_names_of_its_columns() {
        let expected = vec![[0.001, 0.0], [0.002, 0.25], [0.004, 1.0]];
        for text in [
            "radius,share\n0.001,0\n0.002,0.25\n0.004,1\n",
            "# from the laboratory\r\n\r\nshare, diameter\r\n0,2e-3\r\n0.25,0.004\r\n# all\r\n1.0,0.008\r\n",
            "\"radius\",\"share\",note\n0.001,0,pan\n0.002,0.25,\n\"0.004\",1,\n",
            "radius,share\n0.001,0\n0.002,0.25\n0.004,1.0000000\n",
        ] {
            assert_eq!(points("a.csv", text).unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn mistakes_in_a_table_are_told_with_their_line() {
        for (text, part) in [
            ("", "a.csv: there is no row in it"),
            ("# only this\n", "a.csv: there is no row in it"),
            ("r,share\n", "a.csv:1: it begins with r,share"),
            ("radius,mass\n", "a.csv:1: there is no column share"),
            ("radius,diameter,share\n", "a.csv:1: it has a column radius and a column diameter"),
            ("radius,share,share\n", "a.csv:1: column share is named twice"),
            ("radius,share\n0.1\n", "a.csv:2: the row has 1 fields, and the first line names 2"),
            ("radius,share\n\n0.1,x\n", "a.csv:3: share = \"x\" is no finite number"),
            ("radius,share\n0.1,0\n0.2,nan\n", "a.csv:3: share = \"nan\" is no finite number"),
            ("radius,share\n-0.1,0\n", "a.csv:2: radius = -0.1 is not above 0"),
            ("radius,share\n0.1,0.1\n", "a.csv:2: share = 0.1 in the first row"),
            ("radius,share\n0.1,0\n0.2,0.5\n0.2,1\n", "a.csv:4: radius = 0.2 does not rise: 0.2"),
            ("radius,share\n0.1,0\n0.2,0.5\n0.3,0.4\n", "a.csv:4: share = 0.4 falls: 0.5"),
            ("radius,share\n0.1,0\n0.2,50\n", "a.csv:3: share = 50 is outside 0..1"),
            ("radius,share\n0.1,0\n0.2,0.9\n", "a.csv:3: share = 0.9 in the last row"),
            ("radius,share\n0.1,0\n", "a.csv:2: there are less than two rows"),
        ] {
            let found = points("a.csv", text).unwrap_err().to_string();
            assert!(
                found.starts_with(part) && found.contains("must be radius,share or"),
                "{text:?}: {found}"
            );
        }
    }
}
