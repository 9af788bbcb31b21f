//! What a report says of classes of spheres: a line for each, tables and lines of figures.

use super::tables::Table;
use crate::beds::measures::by_class::ByClass;
use crate::beds::plot::Line;
use crate::math::digits::short;

/// Names and values of the measures, as text.
pub fn findings(found: &ByClass) -> Vec<(&'static str, String)> {
    let list = |values: [f64; 3]| values.map(short).join(", ");
    let sizes = &found.sizes;
    let mut lines = vec![(
        "diameters d10, d50, d90",
        format!("{} m by number; {} m by mass", list(sizes.by_number), list(sizes.by_mass)),
    )];
    for (k, row) in found.classes.iter().enumerate() {
        let count = found.classes.len();
        let with = |pair: &crate::beds::measures::by_class::OfPair| {
            format!("{:.2} with {}", pair.mean_coordination, pair.other_class)
        };
        let partners: Vec<String> = found.contacts[k * count..(k + 1) * count].iter().map(with).collect();
        lines.push((
            "class",
            format!(
                "{}: {} spheres ({:.2} %), {:.2} % of the mass, mean radius {} m",
                row.class,
                row.spheres,
                100.0 * row.number_share,
                100.0 * row.mass_share,
                short(row.mean_radius)
            ),
        ));
        lines.push((
            "",
            format!(
                "volume fraction {:.6}; coordination number {:.4}: {}",
                row.volume_fraction,
                row.mean_coordination,
                partners.join(", ")
            ),
        ));
    }
    lines
}

/// The tables.
pub fn tables(found: &ByClass) -> Vec<Table> {
    let number = |value: f64| format!("{value:?}");
    let classes = found.classes.iter().map(|row| {
        vec![
            row.class.clone(),
            row.spheres.to_string(),
            number(row.number_share),
            number(row.mass),
            number(row.mass_share),
            number(row.mean_radius),
            number(row.least_radius),
            number(row.largest_radius),
            number(row.volume_fraction),
            number(row.mean_coordination),
            row.wall_contacts.to_string(),
            row.rattlers.to_string(),
        ]
    });
    let contacts = found.contacts.iter().map(|pair| {
        let names = [pair.class.clone(), pair.other_class.clone(), pair.contacts.to_string()];
        names.into_iter().chain([pair.mean_coordination, pair.mean_force].map(number)).collect()
    });
    let radial = found.radial.iter().flat_map(|around| {
        let d = around.mean_diameter;
        around.distribution.iter().map(move |&[at, g]| {
            let names = [around.class.clone(), around.other_class.clone()];
            names.into_iter().chain([at, at / d, g].map(number)).collect()
        })
    });
    let heads = ["from", "to", "spheres", "mean_radius", "mass"].map(str::to_owned);
    let shares = found.classes.iter().map(|row| format!("mass share of {}", row.class));
    let layers = found.layers.iter().map(|layer| {
        let mean = layer.mean_radius.map(number).unwrap_or_default();
        let own = [number(layer.from), number(layer.to), layer.spheres.to_string(), mean, number(layer.mass)];
        let none = vec![String::new(); found.classes.len()];
        let shares: Vec<String> = layer.mass_shares.iter().copied().map(number).collect();
        own.into_iter().chain(if shares.is_empty() { none } else { shares }).collect()
    });
    let (mut spheres, mut mass) = (0.0, 0.0);
    let sizes = found.sizes.bins.iter().map(|bin| {
        (spheres, mass) = (spheres + bin.number_share, mass + bin.mass_share);
        let own = [number(bin.from), number(bin.to), bin.spheres.to_string()];
        own.into_iter().chain([bin.number_share, bin.mass_share, spheres, mass].map(number)).collect()
    });
    let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<String>>();
    let of_class = "class spheres number_share mass mass_share mean_radius least_radius largest_radius \
                    volume_fraction mean_coordination wall_contacts rattlers";
    let of_sizes = "diameter_from diameter_to spheres number_share mass_share number_up_to mass_up_to";
    vec![
        Table::new("classes.csv", words(of_class), classes.collect()),
        Table::new(
            "class-contacts.csv",
            words("class other_class contacts mean_coordination mean_force"),
            contacts.collect(),
        ),
        Table::new(
            "class-rdf.csv",
            words("class other_class distance distance_over_diameter g"),
            radial.collect(),
        ),
        Table::new("class-height.csv", heads.into_iter().chain(shares).collect(), layers.collect()),
        Table::new("sizes.csv", words(of_sizes), sizes.collect()),
    ]
}

/// Lines of g over the distance in mean diameters, one for each pair of classes.
pub fn radial(found: &ByClass) -> Vec<Line> {
    let line = |around: &crate::beds::measures::by_class::Around| {
        let points = around.distribution.iter().map(|&[at, g]| (at / around.mean_diameter, g)).collect();
        Line { name: format!("{} around {}", around.other_class, around.class), points }
    };
    let apart = |line: &Line| line.points.iter().any(|&(_, g)| g > 0.0);
    found.radial.iter().map(line).filter(apart).collect()
}

/// Lines of the share of each class in the mass of a layer over its height.
pub fn heights(found: &ByClass) -> Vec<Line> {
    let line = |k: usize| {
        let layers = found.layers.iter().filter(|layer| !layer.mass_shares.is_empty());
        let points = layers.map(|layer| (0.5 * (layer.from + layer.to), layer.mass_shares[k])).collect();
        Line { name: found.classes[k].class.clone(), points }
    };
    (0..found.classes.len()).map(line).collect()
}

/// Lines of the shares of spheres, and of their mass, up to a diameter.
pub fn sizes(found: &ByClass) -> Vec<Line> {
    let line = |name: &str, share: &dyn Fn(usize) -> f64| {
        let mut sum = 0.0;
        let bins = found.sizes.bins.iter().enumerate();
        let points = bins.flat_map(|(k, bin)| {
            let before = sum;
            sum += share(k);
            // Those of one diameter come in one step.
            [(bin.from, before), (bin.to, sum)]
        });
        Line { name: name.to_owned(), points: points.collect() }
    };
    let bins = &found.sizes.bins;
    vec![line("by number", &|k| bins[k].number_share), line("by mass", &|k| bins[k].mass_share)]
}
