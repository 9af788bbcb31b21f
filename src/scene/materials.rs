//! Materials of a scene: what spheres and walls are made of, and the law between every two of them.
//!
//! Materials are numbered in the order of the scene. One number more stands for what has no material: it has
//! the coefficients of `[contact]` and `[friction]`.

use serde::{Deserialize, Serialize};

use super::effects::law_with;
use super::source::Source;
use super::{Friction, Scene, brief};
use crate::error::Error;
use crate::model::contact::{Dissipative, Frictionless, Law, LawParameters};
use crate::model::effects::FrictionLaw;
use crate::model::materials::{Classes, Coefficients};

/// What stands for no material where names are told: in plans, in files and in particle files.
pub const NO_MATERIAL: &str = "(none)";

/// Most materials of a scene.
const MOST: usize = 100;

/// A material. A coefficient that is `None` is that of `[contact]` or `[friction]`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Its name.
    pub name: String,
    /// Coefficient of restitution, 0..=1.
    pub restitution: Option<f64>,
    /// Friction coefficient; >= 0.
    pub friction: Option<f64>,
    /// Coefficient of rolling resistance; >= 0.
    pub rolling: Option<f64>,
    /// Coefficient of twisting resistance; >= 0.
    pub twisting: Option<f64>,
    /// What holds between this material and others, in place of the mixing rule.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pair: Vec<MaterialPair>,
}

/// What holds between a material and another one. A coefficient that is `None` is mixed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialPair {
    /// Name of the other material.
    pub with: String,
    /// Coefficient of restitution, 0..=1.
    pub restitution: Option<f64>,
    /// Friction coefficient; >= 0.
    pub friction: Option<f64>,
    /// Coefficient of rolling resistance; >= 0.
    pub rolling: Option<f64>,
    /// Coefficient of twisting resistance; >= 0.
    pub twisting: Option<f64>,
}

/// Names of the coefficients of a material, in the order of all lists of four here.
pub const COEFFICIENTS: [&str; 4] = ["restitution", "friction", "rolling", "twisting"];

impl Material {
    fn given(&self) -> [Option<f64>; 4] {
        [self.restitution, self.friction, self.rolling, self.twisting]
    }
}

impl MaterialPair {
    fn given(&self) -> [Option<f64>; 4] {
        [self.restitution, self.friction, self.rolling, self.twisting]
    }
}

/// What holds between two materials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Between {
    /// The coefficients.
    pub coefficients: Coefficients,
    /// Whether each is given by `[[material.pair]]`, in the order of [`COEFFICIENTS`]. If not it is mixed.
    pub given: [bool; 4],
}

fn numbers(coefficients: &Coefficients) -> [f64; 4] {
    let Coefficients { restitution, friction, rolling, twisting } = *coefficients;
    [restitution, friction, rolling, twisting]
}

fn coefficients([restitution, friction, rolling, twisting]: [f64; 4]) -> Coefficients {
    Coefficients { restitution, friction, rolling, twisting }
}

impl Scene {
    /// Name of the material with this number.
    pub fn material_name(&self, number: usize) -> &str {
        self.material.get(number).map_or(NO_MATERIAL, |material| &material.name)
    }

    /// Number of the material with this `name`, if there is one.
    pub fn material_number(&self, name: &str) -> Option<usize> {
        self.material.iter().position(|material| material.name == name)
    }

    /// Number of the material of a body whose scene says `name`.
    fn number_or_none(&self, name: Option<&str>) -> usize {
        name.and_then(|name| self.material_number(name)).unwrap_or(self.material.len())
    }

    /// The coefficients of `[contact]` and `[friction]`: those of what has no material.
    pub fn plain_coefficients(&self) -> Coefficients {
        let of = |resistance: Option<&super::Resistance>| resistance.map_or(0.0, |table| table.coefficient);
        let friction = self.friction.as_ref();
        Coefficients {
            restitution: self.contact.restitution,
            friction: friction.map_or(0.0, |friction| friction.coefficient),
            rolling: of(friction.and_then(|friction| friction.rolling.as_ref())),
            twisting: of(friction.and_then(|friction| friction.twisting.as_ref())),
        }
    }

    /// The coefficients of contacts within the material with this `number`.
    fn own_coefficients(&self, number: usize) -> Coefficients {
        let plain = numbers(&self.plain_coefficients());
        let given = self.material.get(number).map_or([None; 4], Material::given);
        coefficients(std::array::from_fn(|k| given[k].unwrap_or(plain[k])))
    }

    /// What holds between the materials with the numbers `a` and `b`, in either order: what
    /// `[[material.pair]]` of one of them gives, and for the rest the geometric mean.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::scene::Scene;
    ///
    /// let text = std::fs::read_to_string("configs/quick.toml")?;
    /// let materials = "material=[{ name = 'glass', restitution = 0.9 }, { name = 'clay', friction = 0.8, \
    ///     restitution = 0.1, pair = [{ with = 'glass', friction = 0.5 }] }]";
    /// let scene = Scene::parse("configs/quick.toml", &text, &[materials.to_owned()])?;
    /// let between = scene.between_materials(0, 1);
    /// assert!((between.coefficients.restitution - 0.3).abs() < 1e-15); // sqrt(0.9 * 0.1)
    /// assert_eq!(between.coefficients.friction, 0.5);
    /// assert_eq!(between.given, [false, true, false, false]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn between_materials(&self, a: usize, b: usize) -> Between {
        let mixed = numbers(&self.own_coefficients(a).mixed(&self.own_coefficients(b)));
        let pair = |of: usize, with: usize| {
            let name = &self.material.get(with)?.name;
            self.material.get(of)?.pair.iter().find(|pair| pair.with == *name)
        };
        let given = pair(a, b).or_else(|| pair(b, a)).map_or([None; 4], MaterialPair::given);
        Between {
            coefficients: coefficients(std::array::from_fn(|k| given[k].unwrap_or(mixed[k]))),
            given: given.map(|coefficient| coefficient.is_some()),
        }
    }

    /// All coefficients number `k` that any contact can have or that others are mixed from.
    fn all_coefficients(&self, k: usize) -> impl Iterator<Item = f64> {
        let plain = numbers(&self.plain_coefficients())[k];
        let own = self.material.iter().flat_map(move |material| {
            let pairs = material.pair.iter().filter_map(move |pair| pair.given()[k]);
            material.given()[k].into_iter().chain(pairs)
        });
        std::iter::once(plain).chain(own)
    }

    /// The least coefficient of restitution that any contact may have.
    pub fn least_restitution(&self) -> f64 {
        self.all_coefficients(0).fold(1.0, f64::min)
    }

    /// Whether any contact may lose energy on rebound.
    pub fn dissipates(&self) -> bool {
        self.all_coefficients(0).any(|e| e < 1.0)
    }

    /// Whether any contact may rub: there is friction, and its coefficient is not 0 everywhere.
    pub fn rubs(&self) -> bool {
        self.friction.is_some() && self.all_coefficients(1).any(|friction| friction > 0.0)
    }

    /// Whether any contact may resist rolling, and twisting.
    pub fn resists(&self) -> [bool; 2] {
        let is_on = self.rubs() && self.friction.as_ref().is_some_and(|friction| friction.rotation);
        [2, 3].map(|k| is_on && self.all_coefficients(k).any(|coefficient| coefficient > 0.0))
    }

    /// Numbers of the materials of the walls, in the order of [`walls`](super::walls::walls).
    pub fn wall_materials(&self) -> Vec<usize> {
        let own = |name: &Option<String>| self.number_or_none(name.as_deref());
        let sides = super::walls::walls(&self.container).len() - self.container.wall.len();
        let of_box = self.container.r#box.as_ref().map_or(0, |sides| own(&sides.material));
        let walls = self.container.wall.iter().map(|wall| own(&wall.material));
        std::iter::repeat_n(of_box, sides).chain(walls).collect()
    }
}

/// The parameters of the law of every class of contacts, and which class a contact belongs to. Without
/// materials there is one class.
///
/// Pairs of materials with equal coefficients are one class.
pub fn laws(scene: &Scene) -> (Vec<LawParameters>, Classes) {
    if scene.material.is_empty() {
        return (vec![super::effects::law(scene)], Classes::default());
    }
    let count = scene.material.len() + 1;
    let (mut laws, mut table) = (Vec::new(), vec![0; count * count]);
    for a in 0..count {
        for b in a..count {
            let law = law_with(scene, &scene.between_materials(a, b).coefficients);
            let class = laws.iter().position(|other| *other == law).unwrap_or_else(|| {
                laws.push(law);
                laws.len() - 1
            });
            table[a * count + b] = class as u32;
            table[b * count + a] = class as u32;
        }
    }
    let walls = scene.wall_materials().into_iter().map(|number| number as u32).collect();
    (laws, Classes::new(count, table, walls))
}

/// The normal forces of the contacts of a scene, eqs. (2.1) to (2.5), without friction.
pub struct NormalLaws<'a> {
    laws: Vec<Law<Dissipative, Frictionless>>,
    classes: Classes,
    /// Numbers of the materials of the spheres, by id; empty where nobody has one.
    materials: &'a [u32],
}

impl<'a> NormalLaws<'a> {
    /// Those of spheres with these `materials`, by id, or without any.
    pub fn of(scene: &Scene, materials: &'a [u32]) -> Self {
        let (laws, classes) = laws(scene);
        let normal = |parameters: LawParameters| Law {
            parameters,
            rebound: Dissipative::new(parameters.e, parameters.psi),
            tangential: Frictionless,
        };
        NormalLaws { laws: laws.into_iter().map(normal).collect(), classes, materials }
    }

    fn material(&self, i: usize) -> u32 {
        let none = self.classes.without_material();
        // A column of that name may be a tag of somebody else's.
        self.materials.get(i).map_or(none, |&material| material.min(none))
    }

    /// The parameters that all contacts share: all but the coefficients.
    pub fn shared(&self) -> &LawParameters {
        &self.laws[0].parameters
    }

    /// The law between the spheres with the ids `i` and `j`.
    pub fn of_pair(&self, i: usize, j: usize) -> &Law<Dissipative, Frictionless> {
        &self.laws[self.classes.of_pair(self.material(i), self.material(j))]
    }

    /// The law between the sphere with the id `i` and the wall with the index `wall`.
    pub fn of_wall(&self, i: usize, wall: usize) -> &Law<Dissipative, Frictionless> {
        &self.laws[self.classes.of_wall(self.material(i), wall)]
    }
}

/// Names in quotation marks, with commas between them.
fn shown_names<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.map(|name| format!("\"{}\"", brief(name))).collect::<Vec<_>>().join(", ")
}

/// The names that there are, for messages about one that is not among them.
pub(in crate::scene) fn known(scene: &Scene) -> String {
    match &scene.material[..] {
        [] => "the scene has none: it needs a [[material]] of that name".to_owned(),
        all => format!("it must be one of: {}", shown_names(all.iter().map(|material| &material.name[..]))),
    }
}

/// Checks materials, and that everything that has one has one that exists.
pub(super) fn check(source: &Source, scene: &Scene) -> Result<(), Error> {
    names(source, scene)?;
    for (k, material) in scene.material.iter().enumerate() {
        pairs(source, scene, k, material)?;
    }
    bodies(source, scene)?;
    effects(source, scene)
}

fn names(source: &Source, scene: &Scene) -> Result<(), Error> {
    if scene.material.len() > MOST {
        let message =
            format!("{} materials: at most {MOST} must do, one [[material]] each", scene.material.len());
        return Err(source.error(source.key("material"), &message));
    }
    for (k, Material { name, .. }) in scene.material.iter().enumerate() {
        let path = format!("material[{k}].name");
        let refuse = |why: &str| {
            let message = format!("{path} = {}: {why}", shown_names([&name[..]].into_iter()));
            Err(source.error(source.value(&path), &message))
        };
        if name.trim() != name || name.chars().any(char::is_control) || name == NO_MATERIAL {
            return refuse(
                "it must be a name on one line, without blanks around it, and not \"(none)\", e.g. name = \
                 \"glass\"",
            );
        }
        if let Some(first) = scene.material[..k].iter().position(|other| other.name == *name) {
            let why = format!("material[{first}] has that name: each name may stand there once");
            return refuse(&why);
        }
    }
    Ok(())
}

fn pairs(source: &Source, scene: &Scene, k: usize, material: &Material) -> Result<(), Error> {
    for (p, pair) in material.pair.iter().enumerate() {
        let path = format!("material[{k}].pair[{p}]");
        let with = shown_names([&pair.with[..]].into_iter());
        let refuse = |message: String| {
            let span = source.value(&format!("{path}.with")).or_else(|| source.key("material"));
            Err(source.error(span, &message))
        };
        let Some(other) = scene.material_number(&pair.with) else {
            return refuse(format!("{path}.with = {with} is no material: {}", known(scene)));
        };
        if other == k {
            return refuse(format!(
                "{path}.with = {with} is the material itself: what holds within a material must stand in its \
                 [[material]], e.g. friction = 0.3"
            ));
        }
        if pair.given() == [None; 4] {
            return refuse(format!(
                "{path} with {with} says nothing: it needs {}, e.g. friction = 0.3",
                COEFFICIENTS.join(", ").replace(", twisting", " or twisting")
            ));
        }
        let twice = material.pair[..p].iter().any(|earlier| earlier.with == pair.with);
        let there = scene.material[..k].get(other);
        let back = there.is_some_and(|there| there.pair.iter().any(|back| back.with == material.name));
        if twice || back {
            let at = if back { other } else { k };
            return refuse(format!(
                "{path}.with = {with}: a [[material.pair]] of material[{at}] is about the same two: what \
                 holds between them must stand there once"
            ));
        }
    }
    Ok(())
}

fn bodies(source: &Source, scene: &Scene) -> Result<(), Error> {
    let of_box = scene.container.r#box.as_ref().and_then(|sides| sides.material.as_ref());
    let of_box = of_box.map(|name| ("container.box.material".to_owned(), name));
    let walls = scene.container.wall.iter().enumerate();
    let walls = walls
        .filter_map(|(k, wall)| Some((format!("container.wall[{k}].material"), wall.material.as_ref()?)));
    let species = scene.species.iter().enumerate();
    let species = species
        .filter_map(|(k, species)| Some((format!("species[{k}].material"), species.material.as_ref()?)));
    for (path, name) in of_box.into_iter().chain(walls).chain(species) {
        if scene.material_number(name).is_none() {
            let name = shown_names([&name[..]].into_iter());
            let message = format!("{path} = {name} is no material: {}", known(scene));
            return Err(source.error(source.value(&path), &message));
        }
    }
    Ok(())
}

/// Checks that coefficients above 0 have the law that uses them.
fn effects(source: &Source, scene: &Scene) -> Result<(), Error> {
    let all = scene.material.iter().enumerate().flat_map(|(k, material)| {
        let own = (format!("material[{k}]"), material.given());
        let pairs = material.pair.iter().enumerate();
        let pairs = pairs.map(move |(p, pair)| (format!("material[{k}].pair[{p}]"), pair.given()));
        std::iter::once(own).chain(pairs)
    });
    for (path, given) in all {
        for (k, name) in COEFFICIENTS.into_iter().enumerate().skip(1) {
            if given[k].is_none_or(|coefficient| coefficient == 0.0) {
                continue;
            }
            let needed = match (&scene.friction, name) {
                (None, _) => "[friction], which says how, e.g. law = \"history\" and coefficient = 0.3",
                (Some(_), "friction") => continue,
                (Some(Friction { law: FrictionLaw::Regularized, .. }), _) => "friction.law = \"history\"",
                (Some(Friction { rotation: false, .. }), _) => "friction.rotation = true",
                (Some(_), _) if !scene.rubs() => "a friction coefficient above 0",
                _ => continue,
            };
            let path = format!("{path}.{name}");
            let value = given[k].unwrap_or_default();
            let message = format!("{path} = {value} needs {needed}: without it no contact has {name}");
            return Err(source.error(source.value(&path), &message));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const GLASS: &str = "{ name = 'glass', restitution = 0.9, friction = 0.4, rolling = 0.01 }";

    fn scene(materials: &str) -> Result<Scene, Error> {
        let text = format!(
            "t_end = 1
            particles = {{ radius = 0.1, mass = 1, file = 'a.csv' }}
            contact = {{ repulsion_at_contact = 10, stiffness_exponent = 150, restitution = 0.4,
                        dissipation_focusing = 10, interaction_distance = 0.1 }}
            friction = {{ law = 'history', coefficient = 0.1 }}
            material = [{materials}]"
        );
        Scene::parse("a.toml", &text, &[])
    }

    #[test]
    fn a_material_has_its_own_values_and_those_of_the_scene_where_it_says_nothing() {
        let scene = scene(GLASS).unwrap();
        let glass = scene.between_materials(0, 0).coefficients;
        assert_eq!(numbers(&glass), [0.9, 0.4, 0.01, 0.0]);
        assert_eq!(scene.between_materials(1, 1).coefficients, scene.plain_coefficients());
        let mixed = scene.between_materials(0, 1);
        assert_eq!(mixed, scene.between_materials(1, 0));
        assert!((mixed.coefficients.restitution - 0.6).abs() < 1e-15);
        assert!((mixed.coefficients.friction - 0.2).abs() < 1e-15);
        assert_eq!((mixed.coefficients.rolling, mixed.given), (0.0, [false; 4]));
    }

    #[test]
    fn a_pair_wins_over_mixing_whichever_of_the_two_has_it() {
        let pair = "pair = [{ with = 'steel', friction = 0.05, restitution = 1 }]";
        let back = "pair = [{ with = 'glass', friction = 0.05, restitution = 1 }]";
        let glass = |more: &str| GLASS.replace(" }", &format!(", {more} }}"));
        let one = scene(&format!("{}, {{ name = 'steel', rolling = 0.04 }}", glass(pair))).unwrap();
        let other = scene(&format!("{GLASS}, {{ name = 'steel', rolling = 0.04, {back} }}")).unwrap();
        let between = one.between_materials(0, 1);
        assert_eq!((between.coefficients.restitution, between.coefficients.friction), (1.0, 0.05));
        assert!((between.coefficients.rolling - 0.02).abs() < 1e-15);
        assert_eq!(between.given, [true, true, false, false]);
        for found in [one.between_materials(1, 0), other.between_materials(0, 1)] {
            assert_eq!(found, between);
        }
        assert_eq!(laws(&one), laws(&other));
    }

    #[test]
    fn pairs_with_equal_coefficients_are_one_class() {
        let count = |materials: &str| laws(&scene(materials).unwrap()).0.len();
        assert_eq!(count(""), 1);
        assert_eq!(count("{ name = 'a' }, { name = 'b', friction = 0.1, restitution = 0.4 }"), 1);
        // With like and unlike, and with what has no material.
        assert_eq!(count(GLASS), 3);
        let same = "{ name = 'a', friction = 0.3 }, { name = 'b', friction = 0.3 }";
        assert_eq!(count(same), 3);
        let (found, classes) = laws(&scene(same).unwrap());
        assert_eq!(classes.of_pair(0, 1), classes.of_pair(0, 0));
        assert_eq!(found[classes.of_pair(2, 2)].phi, 0.1);
    }

    #[test]
    fn effects_are_those_of_any_material() {
        let of = |materials: &str| {
            let scene = scene(materials).unwrap();
            (scene.dissipates(), scene.rubs(), scene.resists())
        };
        assert_eq!(of(""), (true, true, [false, false]));
        assert_eq!(of("{ name = 'a', rolling = 0.1 }"), (true, true, [true, false]));
        let pair = "{ name = 'a' }, { name = 'b', pair = [{ with = 'a', twisting = 0.1 }] }";
        assert_eq!(of(pair), (true, true, [false, true]));
        let frictionless = Scene { friction: None, ..scene("").unwrap() };
        assert!(!frictionless.rubs());
    }

    #[test]
    fn walls_have_materials_in_the_order_of_walls() {
        let mut scene = scene("{ name = 'a' }, { name = 'b' }").unwrap();
        let sides = super::super::BoxSides {
            min: [0.0; 3],
            max: [1.0, f64::INFINITY, 1.0],
            material: Some("b".into()),
        };
        let wall = |material: Option<&str>| super::super::WallPlane {
            material: material.map(str::to_owned),
            ..super::super::WallPlane::default()
        };
        scene.container.r#box = Some(sides);
        scene.container.wall = vec![wall(Some("a")), wall(None)];
        assert_eq!(scene.wall_materials(), [1, 1, 1, 1, 1, 0, 2]);
    }
}
