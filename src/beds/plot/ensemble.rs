//! Draws means with their confidence intervals: small panels, one for each statistic or swept key.

use super::axis::Axis;
use super::canvas::{Area, Canvas, Drawn, Pixel};
use super::frame::{Frame, upward_height};
use super::look::{Look, Mark, looks};
use super::sheet::{Sheet, WIDTH};
use crate::error::Error;
use crate::math::interval::Interval;
use std::path::Path;

/// Distance between the bars of different methods at the same x, px.
const APART: i32 = 8;
/// Half the length of the cap at the end of a bar, px.
const CAP: i32 = 3;
const REMARK: &str =
    "Bars: 95 % confidence interval of the mean. Hollow: too few sound runs for an interval.";

/// Kind of the x axis of a panel.
#[derive(Debug, Clone)]
pub enum Across {
    /// Positive numbers such as tolerances.
    Logarithmic,
    /// Numbers.
    Linear,
    /// Categories at equal distances. A bar at 0 belongs to the first one.
    Named(Vec<String>),
}

/// A panel for one statistic.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Name of the statistic, with the unit.
    pub name: String,
    /// Label of the x axis, with the unit.
    pub x_label: String,
    /// Kind of the x axis.
    pub across: Across,
    /// Whether the y axis is logarithmic.
    pub log_y: bool,
    /// Means, in one group for each method.
    pub groups: Vec<Group>,
}

/// The means of one method.
#[derive(Debug, Clone)]
pub struct Group {
    /// Name of the method.
    pub name: String,
    /// Means. If the x axis shows numbers, a line joins them in order.
    pub bars: Vec<Bar>,
}

/// One mean.
#[derive(Debug, Clone)]
pub struct Bar {
    /// Position on the x axis: a number, or the index of a category.
    pub x: f64,
    /// The mean with its interval.
    pub interval: Interval,
}

/// Draws the panels in two columns, or a single panel alone. A name has the same look in all panels.
pub fn ensemble(path: &Path, title: &str, panels: &[Panel]) -> Result<(), Error> {
    let mut names: Vec<&str> = Vec::new();
    for group in panels.iter().flat_map(|panel| &panel.groups) {
        if !names.contains(&group.name.as_str()) {
            names.push(&group.name);
        }
    }
    let looks = looks(names.iter().copied());
    let rooms = panels.iter().map(|panel| match &panel.across {
        Across::Named(categories) => names_room(categories),
        Across::Logarithmic | Across::Linear => 0,
    });
    let extra = rooms.max().unwrap_or(0);
    let sheet = Sheet { title, names: &names, looks: &looks, remark: REMARK, panels: panels.len(), extra };
    sheet.save(path, |canvas, k, area| {
        let panel = &panels[k];
        let look = |group: &Group| names.iter().position(|&name| name == group.name).map(|at| looks[at]);
        let looks: Vec<Look> = panel.groups.iter().filter_map(look).collect();
        draw(canvas, area, panel, &looks)
    })
}

/// Additional height of a panel, px, if the names of categories are too long to fit side by side.
pub fn names_room(categories: &[String]) -> i32 {
    upward_height(&Axis::named("", categories), WIDTH / 2 - 90)
}

/// Draws one panel. `looks` has one look for each group.
fn draw(canvas: &Canvas, outer: Area, panel: &Panel, looks: &[Look]) -> Drawn {
    let bars = || panel.groups.iter().flat_map(|group| &group.bars);
    let numbers = bars().map(|bar| bar.x);
    let x = match &panel.across {
        Across::Logarithmic => Axis::logarithmic(&panel.x_label, numbers),
        Across::Linear => Axis::linear(&panel.x_label, numbers),
        Across::Named(categories) => Axis::named(&panel.x_label, categories),
    };
    let values = bars().flat_map(|bar| {
        let Interval { mean, half_width, .. } = bar.interval;
        [mean - half_width, mean, mean + half_width]
    });
    let y = if panel.log_y { Axis::logarithmic("", values) } else { Axis::linear("", values) };
    let frame = Frame::within(outer, &panel.name, x, y);
    frame.draw(canvas)?;
    for ((number, group), look) in panel.groups.iter().enumerate().zip(looks) {
        let drawn: Vec<(Pixel, Interval)> = (group.bars.iter())
            .filter_map(|bar| Some((bar, frame.at(bar.x, bar.interval.mean)?)))
            .map(|(bar, (x, y))| ((x + aside(panel, number, bar.x), y), bar.interval))
            .collect();
        if !matches!(panel.across, Across::Named(_)) && drawn.len() > 1 {
            canvas.line(drawn.iter().map(|&(at, _)| at).collect(), look.colour, 1)?;
        }
        for &((x, y), Interval { mean, half_width, .. }) in &drawn {
            if half_width.is_finite() {
                // On a logarithmic axis, an interval that includes zero has no lower end.
                let ends = [mean - half_width, mean + half_width]
                    .map(|value| frame.up(frame.y().share(value).unwrap_or(0.0)));
                canvas.line(vec![(x, ends[0]), (x, ends[1])], look.colour, 2)?;
                for end in ends {
                    canvas.line(vec![(x - CAP, end), (x + CAP, end)], look.colour, 2)?;
                }
            }
            let mark = if half_width.is_finite() { Mark::Full } else { Mark::Hollow };
            look.marker(canvas, (x, y), mark)?;
        }
    }
    Ok(())
}

/// Horizontal shift of a bar of group `number` at `x`, px. It keeps the bars of different groups apart.
fn aside(panel: &Panel, number: usize, x: f64) -> i32 {
    let there = |group: &&Group| group.bars.iter().any(|bar| bar.x == x);
    let before = panel.groups[..number].iter().filter(there).count() as i32;
    let all = panel.groups.iter().filter(there).count() as i32;
    (2 * before + 1 - all) * APART / 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_at_the_same_position_stand_side_by_side_and_a_lone_one_in_the_middle() {
        let interval = Interval { mean: 1.0, half_width: 0.1, count: 5 };
        let group =
            |x: &[f64]| Group { name: String::new(), bars: x.iter().map(|&x| Bar { x, interval }).collect() };
        let panel = Panel {
            name: String::new(),
            x_label: String::new(),
            across: Across::Linear,
            log_y: false,
            groups: vec![group(&[0.0, 1.0]), group(&[0.0]), group(&[0.0, 2.0])],
        };
        assert_eq!([0, 1, 2].map(|number| aside(&panel, number, 0.0)), [-APART, 0, APART]);
        assert_eq!((aside(&panel, 0, 1.0), aside(&panel, 2, 2.0)), (0, 0));
    }
}
