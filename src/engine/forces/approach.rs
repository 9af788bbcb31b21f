//! How fast partners approach each other, compared with the way that is left to them.
//!
//! An impact must not lie within one step. While a contact closes with the speed v, a step of size h takes it
//! by v h. Its repulsion grows e-fold on a way of 1/kappa, so a step may go a share of that into an impact:
//!
//! h <= (max(0, l - l_c) + 0.6/kappa) / v
//!
//! From the gap l_c on the repulsion matters to the impact: twice the energy that it stores there is a share
//! of 0.01 of the kinetic energy m_e v^2/2 of the approach, where m_e is m/2 for a pair and m for a wall:
//!
//! l_c = ln(2 F_0/(0.01 kappa m_e v^2))/kappa
//!
//! Surfaces do not interact beyond l_max, so l_c is at most l_max.
//!
//! Beyond l_c, the v of the first formula is the mean speed of a body that falls on with gravity on the way
//! s = l - l_c + 0.6/kappa: (v + sqrt(v^2 + 2 g s))/2, at most 4 v.

use super::block_bodies::BlockBodies;
use super::blocks::each_block;
use super::{Forces, sizes_of};
use crate::engine::kernel::{Closing, for_closing_pairs};
use crate::engine::neighbors::Block;
use crate::math::larger;
use crate::math::vector::Vec3;
use crate::model::columns::{position, velocity};
use crate::model::contact::LawParameters;
use crate::model::size::Size;

/// Share of the kinetic energy of an approach from which the stored energy matters.
const SHARE: f64 = 0.01;

/// How far a step may go into an impact, in units of 1/kappa. With 1 the force is off by 1.5 % of its largest
/// within an impact by Merson's method at the default tolerance, with 0.6 by 0.9 %; beds take the same work.
const DEPTH: f64 = 0.6;

/// Gravity makes an approach at most this many times as fast as it is now, on average. A sphere that hops on
/// a hard floor would else fall into it within a step that its small speed allows.
const MOST_FALL: f64 = 4.0;

/// Finds the fastest approach: the largest v/(max(0, l - l_c) + 0.6/kappa), 1/s.
struct Approach {
    law: LawParameters,
    /// Gravitational acceleration, m/s^2.
    gravity: f64,
    /// Largest rate so far, 1/s.
    most: f64,
}

impl Approach {
    /// Approaches that are not faster than this (m/s) do not count: their rates are at most 4 v over
    /// 0.6/kappa, and at most v + sqrt(0.3 g/kappa) over it.
    #[inline(always)]
    fn slow(&self) -> f64 {
        let way = DEPTH / self.law.kappa;
        let reach = self.most * way;
        (reach / MOST_FALL).max(reach - (0.5 * self.gravity * way).sqrt())
    }

    /// Takes a contact into account. `closing` (m^2/s) is the speed of the approach times the distance.
    ///
    /// The gap (m) is the distance less `surfaces`. `m_e` (kg) is the effective mass. Contacts count up to
    /// the gap `within` (m).
    #[inline(always)]
    fn take(&mut self, closing: f64, squared_distance: f64, [surfaces, within]: [f64; 2], m_e: f64) {
        let LawParameters { kappa, f_0, l_max, .. } = self.law;
        // Most contacts end here.
        let slow = self.slow();
        if closing <= 0.0 || closing * closing <= slow * slow * squared_distance {
            return;
        }
        let distance = squared_distance.sqrt();
        if distance - surfaces > within {
            return;
        }
        let speed = closing / distance;
        let matters = 2.0 * f_0 / (SHARE * kappa * m_e * speed * speed);
        let l_c = (matters.ln() / kappa).min(l_max);
        let free = (distance - surfaces - l_c).max(0.0);
        let left = free + DEPTH / kappa;
        // It falls that way within the time left/mean. What is in contact is carried, and does not fall.
        let gravity = if free > 0.0 { self.gravity } else { 0.0 };
        let mean = 0.5 * (speed + (speed * speed + 2.0 * gravity * left).sqrt());
        self.most = larger(self.most, mean.min(MOST_FALL * speed) / left);
    }
}

/// No approach among some bodies is faster, m/s.
struct Fastest {
    /// To a wall.
    wall: f64,
    /// Of a pair.
    pair: f64,
}

impl Fastest {
    /// The bounds for bodies with these velocities, m/s; infinite where one is NaN.
    ///
    /// A pair is not faster than twice the largest speed, and not faster than the diagonal of the box that
    /// holds all velocities: spheres that fall side by side do not approach each other.
    fn of(velocities: impl Iterator<Item = Vec3>) -> Self {
        let (mut square, mut high, mut low) = (0.0, [f64::NEG_INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for v in velocities {
            square = larger(square, v.norm_squared());
            for k in 0..3 {
                (high[k], low[k]) = (larger(high[k], v[k]), larger(low[k], -v[k]));
            }
        }
        // The margin is more than rounding.
        let margin = 1.0 + 1e-9;
        let diagonal = Vec3::from_fn(|k, _| high[k] + low[k]).norm();
        let wall = margin * square.sqrt();
        Fastest { wall, pair: (2.0 * wall).min(margin * diagonal) }
    }
}

impl Forces {
    /// The largest v/(max(0, l - l_c) + 0.6/kappa) of all contacts of the current bodies, 1/s, or 0 if it is
    /// not more than `least`. Contacts count up to the gap `listed` (m) and the share `travel` of both radii,
    /// or of the diameter at a wall.
    ///
    /// Its inverse is the largest step that no impact forbids.
    ///
    /// A contact across ranks is seen by both.
    pub fn fastest_approach(&mut self, least: f64, listed: f64, travel: f64) -> f64 {
        let Forces { laws, parameters, lists, bounds, block_bodies, width, set, sizes, .. } = self;
        let alike = sizes.is_empty();
        let (law, width) = (laws.first().law(), *width);
        let work = |(blocks, block_bodies): (&[Block], &mut [BlockBodies]), ()| {
            let gravity = parameters.gravity.norm();
            let mut approach = Approach { law, gravity, most: least };
            let (block, BlockBodies { bodies, sizes, batch, .. }) = (&blocks[0], &mut block_bodies[0]);
            let sizes = sizes_of(sizes, laws.first(), parameters);
            let fastest = Fastest::of(bodies.chunks_exact(width).map(velocity));
            let body = |slot: u32| &bodies[slot as usize * width..];
            let within = |surfaces: f64| [surfaces, listed + travel * surfaces];
            if fastest.pair > approach.slow() {
                let reach = if alike { within(2.0 * law.r).iter().sum() } else { f64::INFINITY };
                let slow = approach.slow();
                let closing = Closing { bodies, width, pairs: &block.pairs, batch, slow, reach };
                for_closing_pairs(*set, closing, &mut |[i, j]| {
                    let (a, b) = (body(i), body(j));
                    let apart = position(a) - position(b);
                    let closing = -apart.dot(&(velocity(a) - velocity(b)));
                    let [i, j] = [i, j].map(|slot| sizes.of(slot as usize));
                    // m_i m_j/(m_i + m_j)
                    let m_e = i.mass * (j.mass / (i.mass + j.mass));
                    approach.take(closing, apart.norm_squared(), within(i.r + j.r), m_e);
                    approach.slow()
                });
            }
            let walls = if fastest.wall > approach.slow() { &block.walls[..] } else { &[] };
            for &[i, wall] in walls {
                let Size { r, mass, .. } = sizes.of(i as usize);
                let (body, wall) = (body(i), &parameters.walls[wall as usize]);
                let (depth, speed) = (wall.depth(&position(body)), wall.normal.dot(&velocity(body)));
                // A centre beyond the wall is as deep as can be: its distance counts as 0.
                let depth = depth.max(f64::MIN_POSITIVE.sqrt());
                approach.take(speed * depth, depth * depth, [r, listed + travel * 2.0 * r], mass);
            }
            approach.most
        };
        let most = each_block(bounds, (&lists.blocks[..], &mut block_bodies[..]), (), &work, &larger);
        if most > least { most } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rate of a pair that closes with `speed` (m/s) at the gap `gap` (m).
    fn rate(speed: f64, gap: f64, least: f64) -> f64 {
        falling(speed, gap, least, 0.0)
    }

    /// The same under `gravity` (m/s^2).
    fn falling(speed: f64, gap: f64, least: f64, gravity: f64) -> f64 {
        let law = LawParameters { kappa: 1e4, l_max: 2e-3, ..LawParameters::PAPER };
        let mut approach = Approach { law, gravity, most: least };
        let distance = 0.2 + gap;
        approach.take(speed * distance, distance * distance, [0.2, 0.022], 1.0);
        approach.most
    }

    #[test]
    fn a_step_may_go_a_share_of_an_e_fold_into_an_impact() {
        // At 1 m/s 2 F_0/(0.01 kappa m_e v^2) is 0.2, so the repulsion matters 1.6e-4 m deep.
        let l_c = 0.2f64.ln() / 1e4;
        for gap in [0.01, 1e-4, 0.0, l_c] {
            let expected = 1.0 / (gap - l_c + 0.6e-4);
            assert!((rate(1.0, gap, 0.0) - expected).abs() < 1e-6 * expected, "{gap}");
        }
        // Deeper, a step may change the force by a factor of e^0.6.
        assert!((rate(1.0, -1e-3, 0.0) - 1e4 / 0.6).abs() < 1e-3);
        // A slow approach is stopped early, but not beyond l_max.
        assert!((rate(1e-6, 0.01, 0.0) - 1e-6 / (0.01 - 2e-3 + 0.6e-4)).abs() < 1e-9);
    }

    #[test]
    fn gravity_brings_a_slow_approach_sooner_to_its_impact() {
        // At 0.05 m/s the repulsion matters from l_c = ln(80)/kappa on; the way to 0.6/kappa beyond it is s.
        let way = 1e-3 - 80f64.ln() / 1e4 + 0.6e-4;
        let time = (-0.05 + f64::sqrt(0.05f64.powi(2) + 2.0 * 9.81 * way)) / 9.81;
        assert!((falling(0.05, 1e-3, 0.0, 9.81) * time - 1.0).abs() < 1e-9);
        // What hardly moves is at rest beside its neighbour, and what is in contact is carried.
        let resting = falling(1e-9, 0.01, 0.0, 9.81);
        assert!((resting / (4.0 * rate(1e-9, 0.01, 0.0)) - 1.0).abs() < 1e-9, "{resting}");
        assert_eq!(falling(0.05, 1e-4, 0.0, 9.81), rate(0.05, 1e-4, 0.0));
    }

    #[test]
    fn no_pair_is_faster_than_what_all_velocities_allow() {
        let velocities = [[0.1, 0.0, -4.0], [0.0, 0.2, -4.5], [-0.1, 0.0, -4.2]].map(Vec3::from);
        let Fastest { wall, pair } = Fastest::of(velocities.into_iter());
        // Side by side: the box of velocities is 0.2, 0.2 and 0.5 m/s wide.
        assert!(
            (pair - 0.33f64.sqrt()).abs() < 1e-6 && (wall - 20.29f64.sqrt()).abs() < 1e-6,
            "{pair} {wall}"
        );
        // Against each other: twice the speed.
        let all = [[1.0, 1.0, 1.0], [-1.0, -1.0, -1.0], [1.0, -1.0, 1.0]].map(Vec3::from);
        assert!((Fastest::of(all.into_iter()).pair - 2.0 * 3f64.sqrt()).abs() < 1e-6);
        for k in 0..3 {
            let mut wrong = velocities;
            wrong[k].y = f64::NAN;
            let found = Fastest::of(wrong.into_iter());
            assert!(found.wall == f64::INFINITY && found.pair == f64::INFINITY);
        }
    }

    #[test]
    fn what_is_skipped_early_would_not_have_counted() {
        for (speed, gap) in [(1e-3, 1e-4), (0.05, 1e-3), (0.05, 1e-4), (1.0, 0.01), (10.0, 1e-3), (10.0, 0.0)]
        {
            for gravity in [0.0, 9.81] {
                let exact = falling(speed, gap, 0.0, gravity);
                assert_eq!(falling(speed, gap, 0.999999 * exact, gravity), exact, "{speed} m/s at {gap} m");
                assert_eq!(falling(speed, gap, 1.000001 * exact, gravity), 1.000001 * exact);
            }
        }
    }

    #[test]
    fn what_separates_is_far_or_forbids_nothing_does_not_count() {
        assert_eq!(rate(-1.0, 0.0, 0.0), 0.0);
        assert_eq!(rate(1.0, 0.023, 0.0), 0.0);
        assert_eq!(rate(1.0, 0.01, 1e3), 1e3);
    }
}
