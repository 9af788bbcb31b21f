//! The tables of a report, as CSV with all digits, and its summary as JSON.

use std::path::Path;

use super::measured::Measured;
use crate::beds::folder::cannot_write;
use crate::beds::measures::contacts::Partner;
use crate::error::Error;

/// A table: the name of its file, its head and its rows.
pub struct Table {
    name: &'static str,
    head: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table whose rows are as long as its head.
    pub fn new(name: &'static str, head: Vec<String>, rows: Vec<Vec<String>>) -> Self {
        Table { name, head, rows }
    }
}

/// Writes all tables into `folder`; returns their names.
pub fn write(folder: &Path, measured: &Measured) -> Result<Vec<String>, Error> {
    let mut written = Vec::new();
    let summary = folder.join("summary.json");
    let text = serde_json::to_string_pretty(measured).map_err(|why| cannot_write(&summary, why))?;
    std::fs::write(&summary, text + "\n").map_err(|why| cannot_write(&summary, why))?;
    written.push("summary.json".to_owned());

    let path = folder.join("frames.csv");
    let mut writer = csv::Writer::from_path(&path).map_err(|why| cannot_write(&path, why))?;
    measured.rows.iter().try_for_each(|row| writer.serialize(row)).map_err(|why| cannot_write(&path, why))?;
    writer.flush().map_err(|why| cannot_write(&path, why))?;
    written.push("frames.csv".to_owned());

    let mut table = |name: &str, head: &[&str], rows: Vec<Vec<String>>| -> Result<(), Error> {
        let path = folder.join(name);
        let mut writer = csv::Writer::from_path(&path).map_err(|why| cannot_write(&path, why))?;
        writer.write_record(head).map_err(|why| cannot_write(&path, why))?;
        rows.iter().try_for_each(|row| writer.write_record(row)).map_err(|why| cannot_write(&path, why))?;
        writer.flush().map_err(|why| cannot_write(&path, why))?;
        written.push(name.to_owned());
        Ok(())
    };
    let number = |value: f64| format!("{value:?}");
    let pairs = |rows: &[[f64; 2]]| rows.iter().map(|row| row.map(number).to_vec()).collect();
    let numbers = measured.coordination.iter().enumerate();
    let histogram = numbers.map(|(contacts, spheres)| vec![contacts.to_string(), spheres.to_string()]);
    table("coordination.csv", &["contacts", "spheres"], histogram.collect())?;
    table("height.csv", &["height", "porosity"], pairs(&measured.height_profile))?;
    if !measured.wall_profiles.is_empty() {
        let head: Vec<&str> = ["distance"]
            .into_iter()
            .chain(measured.wall_profiles.iter().map(|(wall, _)| &wall[..]))
            .collect();
        let rows = measured.wall_distances.iter().enumerate().map(|(k, &distance)| {
            let porosities = measured.wall_profiles.iter().map(|(_, porosities)| porosities[k]);
            [distance].into_iter().chain(porosities).map(number).collect()
        });
        table("walls.csv", &head, rows.collect())?;
    }
    table("rdf.csv", &["distance", "g"], pairs(&measured.radial_distribution))?;
    let contacts = measured.contacts.pushing.iter().map(|contact| {
        let (sphere, wall) = match contact.partner {
            Partner::Sphere(j) => (j.to_string(), String::new()),
            Partner::Wall(k) => (String::new(), measured.wall_forces[k].wall.clone()),
        };
        vec![contact.i.to_string(), sphere, wall, number(contact.overlap), number(contact.force)]
    });
    table(
        "contacts.csv",
        &["sphere", "other_sphere", "wall", "overlap", "normal_force"],
        contacts.collect(),
    )?;
    let walls = measured
        .wall_forces
        .iter()
        .map(|wall| vec![wall.wall.clone(), number(wall.normal_force), wall.contacts.to_string()]);
    table("wall-forces.csv", &["wall", "normal_force", "contacts"], walls.collect())?;
    let head: Vec<&str> = measured.series.iter().map(|column| column.series.name()).collect();
    let frames = measured.series.iter().map(|column| column.values.len()).min().unwrap_or(0);
    let rows = (0..frames).map(|k| measured.series.iter().map(|column| number(column.values[k])).collect());
    table("series.csv", &head, rows.collect())?;
    for Table { name, head, rows } in measured.by_class.iter().flat_map(super::classes::tables) {
        let head: Vec<&str> = head.iter().map(|word| &word[..]).collect();
        table(name, &head, rows)?;
    }
    Ok(written)
}
