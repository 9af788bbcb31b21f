//! A scene of a bed from what its user knows: sizes, density, friction, and how far contacts may be pressed
//! in.

use crate::cli::numbers::positive;
use crate::error::Error;
use crate::math::digits::short;
use crate::scene::Scene;
use clap::Args;
use std::io::{BufRead, Write};

/// What a user knows of a bed. What is left out has a usual value.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub struct Known {
    /// Radius of the spheres, m, such as 0.5e-3. This option and those below write a bed of such spheres;
    /// what is left out of them has a usual value
    #[arg(long, value_name = "R", value_parser = positive, allow_negative_numbers = true)]
    radius: Option<f64>,
    /// Their density, kg/m^3; 2500 if left out, that of glass
    #[arg(long, value_name = "RHO", value_parser = positive, allow_negative_numbers = true)]
    density: Option<f64>,
    /// Coefficient of friction: the tangent of the slope on which a block of them starts to slide; 0.345 if
    /// left out
    #[arg(long, value_name = "MU", value_parser = not_negative, allow_negative_numbers = true)]
    friction: Option<f64>,
    /// Largest share of the radius by which the weight of the bed presses spheres into each other; 0.05 if
    /// left out. Half of it takes about 1.5 times as many right-hand sides
    #[arg(long, value_name = "SHARE", value_parser = share, allow_negative_numbers = true)]
    overlap: Option<f64>,
    /// Sides of the box in x and y, m, such as 0.02,0.02; if left out, as wide as the bed is high
    #[arg(long, value_name = "X,Y", value_parser = sides, allow_negative_numbers = true)]
    r#box: Option<[f64; 2]>,
    /// Number of spheres; 2000 if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    count: Option<u64>,
}

impl Known {
    /// Whether nothing is known.
    pub fn is_empty(&self) -> bool {
        *self == Known::default()
    }

    /// Asks for what is not known yet: questions go to `to`, answers come from `from`, a line each. An empty
    /// line takes the usual value.
    pub fn ask(mut self, from: &mut impl BufRead, to: &mut impl Write) -> Result<Self, Error> {
        let mut put = |question: &str, usual: &str, take: &mut dyn FnMut(&str) -> Result<(), String>| loop {
            let unanswered = |why: std::io::Error| Error::Input(format!("{question}: no answer: {why}"));
            write!(to, "{question} [{usual}]: ").and_then(|()| to.flush()).map_err(unanswered)?;
            let mut line = String::new();
            if from.read_line(&mut line).map_err(unanswered)? == 0 {
                return Err(Error::Input(format!("{question}: the answers end here; give it as an option")));
            }
            let answer = line.trim();
            match take(if answer.is_empty() { usual } else { answer }) {
                Ok(()) => return Ok(()),
                Err(why) => writeln!(to, "{answer}: {why}").map_err(unanswered)?,
            }
        };
        fn set<T>(place: &mut Option<T>, found: Result<T, String>) -> Result<(), String> {
            found.map(|found| *place = Some(found))
        }
        if self.radius.is_none() {
            put("radius of the spheres, m", "1e-3", &mut |text| set(&mut self.radius, positive(text)))?;
        }
        if self.density.is_none() {
            put("their density, kg/m^3", "2500", &mut |text| set(&mut self.density, positive(text)))?;
        }
        if self.friction.is_none() {
            put("coefficient of friction", "0.345", &mut |text| set(&mut self.friction, not_negative(text)))?;
        }
        if self.overlap.is_none() {
            let question = "largest overlap by the weight of the bed, as a share of the radius";
            put(question, "0.05", &mut |text| set(&mut self.overlap, share(text)))?;
        }
        if self.count.is_none() {
            let count = |text: &str| match text.parse() {
                Ok(count @ 1..=1_000_000_000) => Ok(count),
                _ => Err("it must be an integer in 1..1000000000".to_owned()),
            };
            put("number of spheres", "2000", &mut |text| set(&mut self.count, count(text)))?;
        }
        if self.r#box.is_none() {
            let usual = usual_sides(self.radius.unwrap_or(RADIUS), self.count.unwrap_or(COUNT)).map(short);
            let usual = format!("{},{}", usual[0], usual[1]);
            put("sides of the box in x and y, m", &usual, &mut |text| set(&mut self.r#box, sides(text)))?;
        }
        Ok(self)
    }

    /// The scene, as text. It falls, settles, and ends where it is at rest.
    pub fn scene(&self) -> Result<String, Error> {
        let Known { radius, density, friction, overlap, r#box, count } = *self;
        let (r, count) = (radius.unwrap_or(RADIUS), count.unwrap_or(COUNT));
        let [x, y] = r#box.unwrap_or_else(|| usual_sides(r, count));
        let spacing = 2.5 * r;
        if let Some(side) = [x, y].into_iter().find(|side| *side < spacing) {
            return Err(Error::Input(format!(
                "--box: a side of {} m has no room for a sphere of {} m and its way to fall: {} m or more \
                 would do",
                short(side),
                short(r),
                short(spacing)
            )));
        }
        // Two digits are enough for times. A bed falls from its height and comes to rest within some hundred
        // times that a sphere takes to fall by its radius.
        let layers = (count as f64 / ((x / spacing).floor() * (y / spacing).floor())).ceil();
        let (fall, time) = ((2.0 * layers * spacing / GRAVITY).sqrt(), (r / GRAVITY).sqrt());
        let t_end = two_digits(10.0 * fall + 400.0 * time);
        let text = format!(
            "\
# A scene of demhybrid: {count} spheres of {r} m fall into a box and settle. SI units. What --dry-run shows
# follows from it: how hard contacts are, and what that costs.

t_end = {t_end}  # s; [stop] ends the run when the bed rests
gravity = [0.0, 0.0, -{GRAVITY}]

[particles]
radius = {r:?}  # m
density = {density:?}  # kg/m^3

[particles.grid]
count = {count}
bottom = 0.0  # m, height of the lowest cells
seed = 1

[container]
box = {{ min = [0.0, 0.0, 0.0], max = [{x:?}, {y:?}, inf] }}  # m

[contact]
overlap = {overlap:?}  # the largest share of the radius that the weight of the bed presses in
restitution = 0.4

[friction]
law = \"history\"
coefficient = {friction:?}

[output]
interval = {interval}  # s between frames

[stop]
unbalanced_force = 1e-3  # net forces over contact forces and weights
",
            r = r,
            density = density.unwrap_or(2500.0),
            friction = friction.unwrap_or(0.345),
            overlap = overlap.unwrap_or(0.05),
            interval = short(two_digits(t_end / 100.0)),
            t_end = short(t_end),
        );
        // Numbers may be beyond what a scene can have.
        Scene::parse("init", &text, &[])?;
        Ok(text)
    }
}

/// Radius of the spheres where nobody gives one, m.
const RADIUS: f64 = 1e-3;

/// Their number.
const COUNT: u64 = 2000;

/// Gravity, m/s^2.
const GRAVITY: f64 = 9.81;

/// The sides of a box in which a bed of `count` spheres of the radius `r` (m) is about as high as wide.
fn usual_sides(r: f64, count: u64) -> [f64; 2] {
    // A bed fills six tenths of its space.
    let volume = 4.0 / 3.0 * std::f64::consts::PI * count as f64 / 0.6;
    [two_digits((volume.cbrt() * r).max(5.0 * r)); 2]
}

/// A positive number with two digits.
fn two_digits(number: f64) -> f64 {
    format!("{number:.1e}").parse().unwrap_or(number)
}

fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number >= 0.0 && number.is_finite() => Ok(number),
        Ok(_) => Err("it must be 0 or more, and finite".into()),
        Err(_) => Err("it must be a number, such as 0.3".into()),
    }
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number < 1.0 => Ok(number),
        Ok(_) => Err("it must be greater than 0 and less than 1".into()),
        Err(_) => Err("it must be a number, such as 0.05".into()),
    }
}

fn sides(text: &str) -> Result<[f64; 2], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|side| positive(side.trim())).collect();
    numbers
        .ok()
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| "it must be two numbers greater than 0 between commas, in m, such as 0.02,0.02".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::initial_condition;

    #[test]
    fn beds_of_any_size_have_contacts_that_are_alike() {
        let of = |r: f64| {
            let known = Known { radius: Some(r), count: Some(300), ..Known::default() };
            let mut scene = Scene::parse("bed.toml", &known.scene().unwrap(), &[]).unwrap();
            let start = initial_condition::grid(&scene, scene.particles.grid.as_ref().unwrap());
            initial_condition::check(&scene, &start).unwrap();
            scene.settle_contacts(&start).unwrap();
            let (contact, weight) = (&scene.contact, scene.particles.mass * GRAVITY);
            [
                contact.repulsion_at_contact / weight,
                contact.stiffness_exponent * r,
                contact.interaction_distance / r,
                contact.dissipation_focusing * (GRAVITY * r).sqrt(),
            ]
        };
        let bead = of(1e-3);
        assert!((bead[0] - 1.0).abs() < 1e-12 && (bead[3] - 10.0).abs() < 1e-12, "{bead:?}");
        for r in [1e-5, 0.03, 1.0, 20.0] {
            for (number, of_bead) in of(r).into_iter().zip(bead) {
                // Sides of boxes have two digits.
                assert!((number / of_bead - 1.0).abs() < 0.02, "{r}: {number} {of_bead}");
            }
        }
    }

    #[test]
    fn answers_and_options_give_the_same_scene() {
        let known = Known { radius: Some(2e-3), ..Known::default() };
        let mut questions = Vec::new();
        let asked = known.ask(&mut "1200\n\n2\n0.02\n50\n0.02,0.03\n".as_bytes(), &mut questions).unwrap();
        let questions = String::from_utf8(questions).unwrap();
        // A share of 2 is refused, with what would be right, and asked for again.
        assert!(questions.contains("2: it must be greater than 0 and less than 1"), "{questions}");
        let given = Known {
            radius: Some(2e-3),
            density: Some(1200.0),
            friction: Some(0.345),
            overlap: Some(0.02),
            r#box: Some([0.02, 0.03]),
            count: Some(50),
        };
        assert_eq!(asked, given);
        let ends = Known::default().ask(&mut "1e-3\n".as_bytes(), &mut Vec::new()).unwrap_err();
        assert!(ends.to_string().contains("density"), "{ends}");
        assert_eq!(ends.exit_code(), 2);
    }

    #[test]
    fn a_box_without_room_is_refused() {
        let known = Known { radius: Some(0.1), r#box: Some([0.2, 1.0]), ..Known::default() };
        let refused = known.scene().unwrap_err().to_string();
        assert!(refused.contains("--box") && refused.contains("0.25 m or more"), "{refused}");
    }
}
