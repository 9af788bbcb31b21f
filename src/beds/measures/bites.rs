//! What many other spheres take from one sphere.
//!
//! A large sphere among small ones overlaps so many of them that to look at all cuts together would take the
//! cube of their number. But each takes a small cap, and few of these meet. So the caps are put into groups
//! of those that meet, which are few, and each group takes its own volume.

use std::f64::consts::PI;

use super::flat::Flat;
use super::union::{Ball, TOLERANCE, volume_between};
use crate::math::polyhedron::Half;
use crate::math::sized_cells::SizedCells;
use crate::math::vector::Vec3;

/// Up to this number of cuts a ball is looked at as a whole.
pub const FEW: usize = 12;

/// Volume (m^3) that the caps beyond all `cuts` have in common with `inside`, a part of a ball around `x`
/// (m).
///
/// What several caps cover counts once.
pub fn taken(inside: &Ball, x: &Vec3, cuts: &[Half]) -> f64 {
    let r = inside.r;
    let local = cuts.iter().map(|half| half.moved(&-x));
    // A cap of almost no height has almost no volume.
    let caps: Vec<Half> = local.filter(|half| half.b < r * (1.0 - 1e-15)).collect();
    let base = inside.heights();
    groups(&caps, r).iter().map(|group| taken_by_group(inside, &base, group)).sum()
}

/// Volume (m^3) that a group of caps has in common with `inside`, whose sections change at the heights
/// `base`.
fn taken_by_group(inside: &Ball, base: &[f64], group: &[Half]) -> f64 {
    let r = inside.r;
    let (mut within, mut apart) = (true, true);
    for cap in group {
        let [is_within, is_apart] = place(inside, cap);
        (within, apart) = (within && is_within, apart && is_apart);
    }
    if apart {
        return 0.0;
    }
    if let ([cap], true) = (group, within) {
        let h = r - cap.b;
        return PI * h * h * (3.0 * r - h) / 3.0;
    }
    let rest = inside.cut(group.iter().copied());
    // The caps end at these heights.
    let high = group.iter().map(|cap| end_of_cap(r, cap, &Vec3::z())).fold(-r, f64::max);
    let low = group.iter().map(|cap| -end_of_cap(r, cap, &-Vec3::z())).fold(r, f64::min);
    let mut heights = rest.heights();
    heights.extend_from_slice(base);
    heights.retain(|&height| height > low && height < high);
    heights.extend([low, high]);
    heights.sort_unstable_by(f64::total_cmp);
    heights.dedup_by(|b, a| *b - *a < 1e-13 * r);
    let mut flat = Flat::default();
    let up = Vec3::z();
    let area = |z: f64| inside.section(&up, z, &mut flat) - rest.section(&up, z, &mut flat);
    // All groups together cover the surface of the ball once at most.
    let width2 = (high - low).powi(2).min(r * r);
    volume_between(&heights, area, TOLERANCE * width2 * r).max(0.0)
}

/// Whether a cap is entirely inside what bounds a part of a ball, and whether it is entirely outside.
fn place(inside: &Ball, cap: &Half) -> [bool; 2] {
    let r = inside.r;
    let (mut within, mut apart) = (true, false);
    for half in &inside.halves {
        within &= end_of_cap(r, cap, &half.n) <= half.b;
        apart |= -end_of_cap(r, cap, &-half.n) >= half.b;
    }
    if let Some((axis, radius)) = inside.pillar {
        // A ball around the cap: that of its rim, if the cap is no more than half of the whole ball.
        let (middle, reach) = if cap.b > 0.0 { (cap.n * cap.b, rim(r, cap.b)) } else { (Vec3::zeros(), r) };
        let away = (middle.x - axis[0]).hypot(middle.y - axis[1]);
        within &= away + reach <= radius;
        apart |= away >= radius + reach;
    }
    [within, apart]
}

/// Radius of the circle in which a plane at the distance `b` (m) cuts a ball of radius `r` (m), m.
fn rim(r: f64, b: f64) -> f64 {
    ((r - b) * (r + b)).max(0.0).sqrt()
}

/// How far the part of a ball of radius `r` (m) inside a half-space reaches along the unit vector `n`, m.
fn end(r: f64, half: &Half, n: &Vec3) -> f64 {
    let cosine = half.n.dot(n);
    match r * cosine <= half.b {
        true => r,
        false => cosine * half.b + half.n.cross(n).norm() * rim(r, half.b),
    }
}

/// How far the cap of a ball beyond the plane of a half-space reaches along `n`, m.
fn end_of_cap(r: f64, half: &Half, n: &Vec3) -> f64 {
    end(r, &Half { n: -half.n, b: -half.b }, n)
}

/// Drops the half-spaces that have no effect on a ball at `x` (m) because another one cuts off their cap.
///
/// Returns whether two of them leave nothing of the ball, or one does.
pub fn drop_shadowed(x: &Vec3, r: f64, halves: &mut Vec<Half>) -> bool {
    let local = |half: &Half| half.moved(&-x);
    halves.retain(|half| local(half).b < r);
    halves.sort_by(|a, b| local(a).b.total_cmp(&local(b).b));
    // Small caps of a large ball shadow almost none of each other. Only large ones are looked at.
    let large: Vec<Half> = halves.iter().map(local).take(4 * FEW).collect();
    let mut empty = large.iter().any(|half| half.b <= -r);
    let mut kept = Vec::new();
    for (k, half) in halves.iter().enumerate() {
        let own = local(half);
        let earlier = &large[..k.min(large.len())];
        empty |= earlier.iter().any(|other| -end(r, other, &-own.n) >= own.b);
        if !earlier.iter().any(|other| end(r, other, &own.n) <= own.b) {
            kept.push(*half);
        }
    }
    *halves = kept;
    empty
}

/// The caps of a ball of radius `r` (m), in groups of those that meet, directly or by others.
fn groups(caps: &[Half], r: f64) -> Vec<Vec<Half>> {
    let opening = |k: usize| (caps[k].b / r).clamp(-1.0, 1.0).acos();
    // On the unit sphere, caps that meet have axes no further apart than the sum of these lengths.
    let axes: Vec<Vec3> = caps.iter().map(|cap| cap.n).collect();
    let lengths: Vec<f64> = (0..caps.len()).map(|k| 2.0 * (0.5 * opening(k)).sin()).collect();
    let sum = |a: f64, b: f64| a + b;
    let cells = SizedCells::new(&axes, Some(&|k| lengths[k]), &sum);
    let mut leader: Vec<usize> = (0..caps.len()).collect();
    fn first(leader: &mut [usize], mut k: usize) -> usize {
        while leader[k] != k {
            leader[k] = leader[leader[k]];
            k = leader[k];
        }
        k
    }
    for k in 0..caps.len() {
        cells.for_each_near(&axes[k], lengths[k], &sum, |l| {
            let chord2 = (axes[k] - axes[l]).norm_squared();
            if l < k && chord2 <= (lengths[k] + lengths[l]).powi(2) {
                let (a, b) = (first(&mut leader, k), first(&mut leader, l));
                leader[a.max(b)] = a.min(b);
            }
        });
    }
    let mut groups: Vec<Vec<Half>> = vec![Vec::new(); caps.len()];
    for (k, cap) in caps.iter().enumerate() {
        groups[first(&mut leader, k)].push(*cap);
    }
    groups.retain(|group| !group.is_empty());
    groups
}

#[cfg(test)]
#[path = "bites_tests.rs"]
mod tests;
