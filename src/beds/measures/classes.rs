//! Classes of spheres: their species, or classes of size.

use crate::files::output::Species;
use crate::math::digits::short;
use crate::model::size::Size;

/// Up to this number of radii each radius is a class, where nobody asks for another number.
const MOST_RADII: usize = 4;
/// Number of classes of equal counts, where there are more radii.
const USUAL: usize = 3;
/// Largest number of classes: each pair of them has measures of its own.
pub const MOST: usize = 20;
/// Radii that differ by less than this share are the same.
const SAME: f64 = 1e-6;

/// A class for each sphere. No class is empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Classes {
    /// Their names.
    pub names: Vec<String>,
    /// For each sphere the index of its class.
    pub of: Vec<usize>,
}

impl Classes {
    /// The classes of spheres with these `sizes` and perhaps a `species`.
    ///
    /// With a `count` these are as many classes of size. Without one they are the species; where there are
    /// none, only one, or more than [`MOST`], each radius is a class if there are at most four, otherwise
    /// there are three classes. Classes of size hold about equally many spheres, and a class for each radius
    /// where there are no more radii than classes.
    ///
    /// `None` where there is nothing to tell spheres apart by: no `sizes`, which means that all are alike,
    /// and no species, or none that counts.
    ///
    /// # Examples
    ///
    /// ```rust
    /// use demhybrid::beds::measures::classes::Classes;
    /// use demhybrid::model::size::Size;
    ///
    /// let sizes = [0.1, 0.2, 0.1].map(|r| Size::new(r, 1.0));
    /// let classes = Classes::of(&sizes, None, None).ok_or("all are alike")?;
    /// assert_eq!(classes.names, ["r = 0.1 m", "r = 0.2 m"]);
    /// assert_eq!(classes.of, [0, 1, 0]);
    /// # Ok::<(), &str>(())
    /// ```
    pub fn of(sizes: &[Size], species: Option<&Species>, count: Option<usize>) -> Option<Self> {
        if let (Some(species), None) = (species, count) {
            let of: Vec<usize> = species.of.iter().map(|&k| k as usize).collect();
            let classes = Self::used(species.names.clone(), of);
            // One species tells nothing apart, where sizes may.
            if classes.count() <= MOST && (classes.count() > 1 || sizes.is_empty()) {
                return Some(classes);
            }
        }
        let mut radii: Vec<f64> = sizes.iter().map(|size| size.r).collect();
        radii.sort_unstable_by(f64::total_cmp);
        // Each is compared with the first of its class: many that differ little make no chain.
        let mut distinct: Vec<f64> = Vec::new();
        for &r in &radii {
            if distinct.last().is_none_or(|&first| r > first * (1.0 + SAME)) {
                distinct.push(r);
            }
        }
        if sizes.is_empty() {
            return None;
        }
        if distinct.len() <= count.unwrap_or(MOST_RADII) {
            let names = distinct.iter().map(|&r| format!("r = {} m", short(r))).collect();
            return Some(Self::between(sizes, &distinct[1..], names));
        }
        let count = count.unwrap_or(USUAL).max(1);
        let mut bounds: Vec<f64> = (1..count).map(|k| radii[k * radii.len() / count]).collect();
        bounds.retain(|&bound| bound > radii[0]);
        bounds.dedup();
        let names = (0..=bounds.len()).map(|k| {
            // From the least to the largest radius of the class.
            let least = if k == 0 { radii[0] } else { bounds[k - 1] };
            let next = bounds.get(k).map_or(radii.len(), |&bound| radii.partition_point(|&r| r < bound));
            match [least, radii[next - 1]].map(short) {
                [least, most] if least == most => format!("r = {least} m"),
                [least, most] => format!("r = {least} to {most} m"),
            }
        });
        Some(Self::between(sizes, &bounds, names.collect()))
    }

    /// Classes of the spheres between radii, of which `bounds` (m) has the least of each class but the first.
    fn between(sizes: &[Size], bounds: &[f64], names: Vec<String>) -> Self {
        let of = sizes.iter().map(|size| bounds.partition_point(|&bound| bound <= size.r)).collect();
        Classes { names, of }
    }

    /// The classes that any sphere is in.
    fn used(names: Vec<String>, of: Vec<usize>) -> Self {
        let mut number = vec![None; names.len()];
        of.iter().for_each(|&k| number[k] = Some(0));
        let mut kept = Vec::new();
        for (name, number) in names.into_iter().zip(&mut number).filter(|(_, number)| number.is_some()) {
            *number = Some(kept.len());
            kept.push(name);
        }
        Classes { names: kept, of: of.into_iter().filter_map(|k| number[k]).collect() }
    }

    /// Number of classes.
    pub fn count(&self) -> usize {
        self.names.len()
    }

    /// The values of all spheres, by class.
    pub fn split<T: Copy>(&self, values: &[T]) -> Vec<Vec<T>> {
        let mut split = vec![Vec::new(); self.count()];
        for (&class, &value) in self.of.iter().zip(values) {
            split[class].push(value);
        }
        split
    }

    /// For each class the sum over its spheres, where sphere `i` adds `of(i)`.
    pub fn sums(&self, of: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.count()];
        self.of.iter().enumerate().for_each(|(i, &class)| sums[class] += of(i));
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sizes(radii: &[f64]) -> Vec<Size> {
        radii.iter().map(|&r| Size::new(r, 1.0)).collect()
    }

    #[test]
    fn up_to_four_radii_are_a_class_each_and_more_make_three_classes() {
        let four = Classes::of(&sizes(&[3.0, 1.0, 2.0, 4.0, 1.0 + 1e-9]), None, None).unwrap();
        assert_eq!(four.names, ["r = 1 m", "r = 2 m", "r = 3 m", "r = 4 m"]);
        assert_eq!(four.of, [2, 0, 1, 3, 0]);
        let six = Classes::of(&sizes(&[6.0, 5.0, 4.0, 3.0, 2.0, 1.0]), None, None).unwrap();
        assert_eq!(six.names, ["r = 1 to 2 m", "r = 3 to 4 m", "r = 5 to 6 m"]);
        assert_eq!(six.of, [2, 2, 1, 1, 0, 0]);
        let asked = |count| Classes::of(&sizes(&[6.0, 5.0, 4.0, 3.0, 2.0, 1.0]), None, Some(count)).unwrap();
        assert_eq!([asked(1).count(), asked(2).count(), asked(6).count(), asked(9).count()], [1, 2, 6, 6]);
        assert_eq!(asked(2).of, [1, 1, 1, 0, 0, 0]);
        assert_eq!(asked(1).names, ["r = 1 to 6 m"]);
    }

    #[test]
    fn spheres_of_one_radius_stay_together() {
        // Most are of one size: there is no third class between them.
        let radii = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        let classes = Classes::of(&sizes(&radii), None, None).unwrap();
        assert_eq!(classes.names, ["r = 1 m", "r = 2 to 5 m"]);
        assert_eq!(classes.of, [0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1]);
    }

    #[test]
    fn species_are_classes_if_nobody_asks_for_a_number_of_them() {
        let names = ["glass", "none of it", "steel"].map(str::to_owned).to_vec();
        let species = Species { names, of: vec![2, 0, 2] };
        let classes = Classes::of(&[], Some(&species), None).unwrap();
        assert_eq!(classes.names, ["glass", "steel"]);
        assert_eq!(classes.of, [1, 0, 1]);
        assert_eq!(classes.split(&[10, 20, 30]), [vec![20], vec![10, 30]]);
        assert_eq!(classes.sums(|i| i as f64), [1.0, 2.0]);
        // Too many of them to measure each with each.
        let many = Species { names: (0..21).map(|k| k.to_string()).collect(), of: (0..21).collect() };
        assert_eq!(Classes::of(&[], Some(&many), None), None);
        let by_size = Classes::of(&sizes(&[1.0, 2.0, 1.0]), Some(&species), Some(2)).unwrap();
        assert_eq!(by_size.of, [0, 1, 0]);
        let alone = Species { names: vec!["sand".to_owned()], of: vec![0, 0] };
        assert_eq!(Classes::of(&[], Some(&alone), None).unwrap().names, ["sand"]);
        let apart = Classes::of(&sizes(&[1.0, 2.0]), Some(&alone), None).unwrap();
        assert_eq!(apart.names, ["r = 1 m", "r = 2 m"]);
        assert_eq!(Classes::of(&[], None, None), None);
        assert_eq!(Classes::of(&[], Some(&species), Some(2)), None);
    }
}
