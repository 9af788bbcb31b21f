//! Exact areas of intersections of discs and half-planes in a plane.

use std::f64::consts::{PI, TAU};

/// A point of the plane, m.
pub type Point = [f64; 2];

/// The intersection of all of the discs and half-planes, which is convex. There must be at least one disc.
#[derive(Debug, Default, Clone)]
pub struct Flat {
    discs: Vec<(Point, f64)>,
    /// The points p with n . p <= b, as the unit normal n and b (m).
    halves: Vec<(Point, f64)>,
    empty: bool,
}

fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

impl Flat {
    /// Removes all discs and half-planes.
    pub fn clear(&mut self) {
        self.discs.clear();
        self.halves.clear();
        self.empty = false;
    }

    /// Keeps only the points within `radius` (m) of `centre`.
    pub fn within(&mut self, centre: Point, radius: f64) {
        self.empty |= radius <= 0.0;
        self.discs.push((centre, radius));
    }

    /// Keeps only the points p with n . p <= b. The length of `n` is at most 1; a length of 0 keeps all
    /// points or none.
    pub fn below(&mut self, n: Point, b: f64) {
        let length = n[0].hypot(n[1]);
        if length < 1e-12 {
            self.empty |= b < 0.0;
            return;
        }
        let (n, b) = ([n[0] / length, n[1] / length], b / length);
        // The same line twice would count the same part of the boundary twice.
        let same =
            |&(m, c): &(Point, f64)| dot(m, n) > 1.0 - 1e-14 && (c - b).abs() < 1e-14 * (1.0 + b.abs());
        if !self.halves.iter().any(same) {
            self.halves.push((n, b));
        }
    }

    /// The area, m^2: half the integral of x dy - y dx along the boundary.
    pub fn area(&self) -> f64 {
        if self.empty {
            return 0.0;
        }
        let mut twice = 0.0;
        let mut removed = Vec::new();
        for (k, &(centre, radius)) in self.discs.iter().enumerate() {
            removed.clear();
            for &(n, b) in &self.halves {
                // The circle is outside the half-plane where cos(angle - angle of n) > q.
                let q = (b - dot(n, centre)) / radius;
                if q <= -1.0 {
                    return 0.0;
                }
                if q < 1.0 {
                    removed.push((n[1].atan2(n[0]), q.acos()));
                }
            }
            for (other, &(its_centre, its_radius)) in self.discs.iter().enumerate().filter(|&(l, _)| l != k) {
                let apart = [centre[0] - its_centre[0], centre[1] - its_centre[1]];
                let distance = apart[0].hypot(apart[1]);
                if distance >= radius + its_radius {
                    return 0.0;
                }
                if distance + radius < its_radius || (distance + radius == its_radius && k < other) {
                    continue;
                }
                if distance + its_radius <= radius {
                    removed.push((0.0, PI));
                    continue;
                }
                let q =
                    (its_radius.powi(2) - distance * distance - radius * radius) / (2.0 * radius * distance);
                removed.push((apart[1].atan2(apart[0]), q.clamp(-1.0, 1.0).acos()));
            }
            for_each_kept(&mut removed, |from, to| {
                let across = to.sin() - from.sin();
                let along = to.cos() - from.cos();
                twice += radius * (radius * (to - from) + centre[0] * across - centre[1] * along);
            });
        }
        for (k, &(n, b)) in self.halves.iter().enumerate() {
            // The line consists of the points n b + t m, with the area to the left of m.
            let m = [-n[1], n[0]];
            let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
            for &(centre, radius) in &self.discs {
                let half = radius.powi(2) - (b - dot(n, centre)).powi(2);
                let half = if half > 0.0 { half.sqrt() } else { f64::NEG_INFINITY };
                (from, to) = (from.max(dot(m, centre) - half), to.min(dot(m, centre) + half));
            }
            for (_, &(its_n, its_b)) in self.halves.iter().enumerate().filter(|&(l, _)| l != k) {
                let (slope, room) = (dot(its_n, m), its_b - b * dot(its_n, n));
                if slope.abs() < 1e-14 {
                    // The lines are parallel. This one is outside the other half-plane, or entirely inside.
                    to = if room < 0.0 { f64::NEG_INFINITY } else { to };
                } else if slope > 0.0 {
                    to = to.min(room / slope);
                } else {
                    from = from.max(room / slope);
                }
            }
            twice += b * (to - from).max(0.0);
        }
        // If the shape is empty but no disc is outside a line or another disc, rounding errors remain.
        (0.5 * twice).max(0.0)
    }
}

/// Calls `visit` with both ends (rad) of every arc of the circle that is in none of the `removed` arcs.
///
/// A removed arc is given as its middle and its half width, rad.
fn for_each_kept(removed: &mut [(f64, f64)], mut visit: impl FnMut(f64, f64)) {
    if removed.iter().any(|&(_, half)| half >= PI) {
        return;
    }
    let Some(&(middle, half)) = removed.first() else {
        return visit(0.0, TAU);
    };
    // Count angles from the end of the first arc.
    let start = middle + half;
    let begin = |(middle, half): (f64, f64)| (middle - half - start).rem_euclid(TAU);
    removed.sort_unstable_by(|&a, &b| begin(a).total_cmp(&begin(b)));
    let mut end: f64 = 0.0;
    // Arcs that begin before the start may extend past it.
    for &each in removed.iter() {
        end = end.max(begin(each) + 2.0 * each.1 - TAU);
    }
    for &each in removed.iter() {
        let first = begin(each);
        if first > end {
            visit(start + end, start + first);
        }
        end = end.max(first + 2.0 * each.1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn simple_shapes_have_their_areas() {
        let mut flat = Flat::default();
        flat.within([3.0, -2.0], 0.5);
        let close = |area: f64, exact: f64| assert!((area - exact).abs() < 1e-14, "{area} {exact}");
        close(flat.area(), PI / 4.0);
        flat.below([1.0, 0.0], 3.0);
        close(flat.area(), PI / 8.0);
        flat.below([0.0, -0.5], 1.0);
        close(flat.area(), PI / 16.0);
        // The same line twice, and a line that misses.
        flat.below([0.5, 0.0], 1.5);
        flat.below([1.0, 0.0], 9.0);
        close(flat.area(), PI / 16.0);
        flat.below([-1.0, 0.0], -3.0);
        close(flat.area(), 0.0);

        // A square inside a disc.
        flat.clear();
        flat.within([0.1, 0.2], 5.0);
        for n in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
            flat.below(n, 0.5);
        }
        close(flat.area(), 1.0);

        // The lens of two discs, and one disc inside the other.
        flat.clear();
        flat.within([0.0, 0.0], 1.0);
        flat.within([1.0, 0.0], 1.0);
        close(flat.area(), 2.0 * PI / 3.0 - 3f64.sqrt() / 2.0);
        flat.clear();
        flat.within([0.0, 0.0], 1.0);
        flat.within([0.1, 0.0], 0.5);
        close(flat.area(), PI / 4.0);
        flat.within([9.0, 0.0], 0.5);
        close(flat.area(), 0.0);
        flat.clear();
        flat.within([0.1, 0.7], 0.5);
        flat.within([0.1, 0.7], 0.5);
        close(flat.area(), PI / 4.0);
    }

    #[test]
    fn random_shapes_have_the_area_that_a_grid_counts() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut draw = move || random.random_range(-1.0..1.0);
        for case in 0..60 {
            let mut flat = Flat::default();
            flat.within([0.0, 0.0], 1.0);
            if case % 2 == 0 {
                flat.within([draw(), draw()], 0.8 + 0.5 * draw());
            }
            for _ in 0..case % 5 {
                let angle = PI * draw();
                flat.below([angle.cos(), angle.sin()], 0.9 * draw());
            }
            const N: i32 = 800;
            let inside = |p: Point| {
                flat.discs.iter().all(|&(c, r)| (p[0] - c[0]).hypot(p[1] - c[1]) <= r)
                    && flat.halves.iter().all(|&(n, b)| dot(n, p) <= b)
            };
            let at = |k: i32| (f64::from(k) + 0.5) / f64::from(N / 2) - 1.0;
            let hits = (0..N * N).filter(|k| inside([at(k % N), at(k / N)])).count();
            let counted = hits as f64 * 4.0 / f64::from(N * N);
            assert!((flat.area() - counted).abs() < 1e-3, "{case}: {} {counted} {flat:?}", flat.area());
        }
    }
}
