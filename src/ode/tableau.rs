//! Explicit Runge-Kutta methods as tables of coefficients.

use super::MethodName;

/// An explicit Runge-Kutta method with an error estimate.
///
/// # Examples
///
/// ```rust
/// use demhybrid::ode::{DORMAND_PRINCE, MERSON};
///
/// for table in [&MERSON, &DORMAND_PRINCE] {
///     // A method of order 2 or more integrates a slope that grows with time exactly.
///     let sum: f64 = table.b.iter().zip(table.c).map(|(b, c)| b * c).sum();
///     assert!((sum - 0.5).abs() < 1e-15);
/// }
/// assert_eq!((MERSON.stages(), DORMAND_PRINCE.stages()), (5, 7));
/// ```
#[derive(Debug)]
pub struct Tableau {
    /// Name in the scene file.
    pub name: MethodName,
    /// Order of the result.
    pub order: u32,
    /// Times of the stages as shares of the step.
    pub c: &'static [f64],
    /// Row s holds the weights of the slopes 0..s in stage s.
    pub a: &'static [&'static [f64]],
    /// Weights of the slopes in the result.
    pub b: &'static [f64],
    /// Weights of the slopes in the error rate: 3/h times the estimate of the local error. For Merson's
    /// method this is the published rate.
    pub error: &'static [f64],
    /// The power of h with which the error of a step shrinks.
    pub error_order: f64,
    /// Whether the last stage is the result, so that its slope is the first one of the next step.
    pub first_same_as_last: bool,
    /// Dense output: weights of the slopes in the state at a share of the step. Its order is one less than
    /// that of the result.
    ///
    /// None if the method has no dense output; every frame then takes a step of its own.
    pub dense: Option<fn(f64) -> [f64; 7]>,
    /// Largest stable step times the spectral radius, where the stiff part is damped.
    pub real_stability: f64,
}

impl Tableau {
    /// Number of stages.
    pub fn stages(&self) -> usize {
        self.b.len()
    }
}

/// Merson's method of order 4 with five stages.
///
/// R. H. Merson (1957); J. Christiansen, Numer. Math. 14 (1970) 317.
///
/// The error rate and the step size rule are those of the paper's solver (P. Strachota, M. Beneš, ALGORITMY
/// 2016, 23-32): the rate is 3/h times Merson's estimate of the local error.
pub const MERSON: Tableau = Tableau {
    name: MethodName::Merson,
    order: 4,
    c: &[0.0, 1.0 / 3.0, 1.0 / 3.0, 0.5, 1.0],
    a: &[&[], &[1.0 / 3.0], &[1.0 / 6.0, 1.0 / 6.0], &[0.125, 0.0, 0.375], &[0.5, 0.0, -1.5, 2.0]],
    b: &[1.0 / 6.0, 0.0, 0.0, 2.0 / 3.0, 1.0 / 6.0],
    error: &[0.2, 0.0, -0.9, 0.8, -0.1],
    error_order: 5.0,
    first_same_as_last: false,
    dense: None,
    real_stability: 3.54,
};

/// The method of Dormand and Prince of order 5, with an embedded method of order 4.
///
/// The last of its seven stages is the first of the next step: a step takes six right-hand sides.
///
/// J. R. Dormand, P. J. Prince, J. Comput. Appl. Math. 6 (1980) 19-26, table 2; MATLAB's ode45.
pub const DORMAND_PRINCE: Tableau = Tableau {
    name: MethodName::DormandPrince,
    order: 5,
    c: &[0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0],
    a: &[
        &[],
        &[0.2],
        &[3.0 / 40.0, 9.0 / 40.0],
        &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
        &[19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0],
        &[9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0],
        &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
    ],
    b: &[35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0, 0.0],
    // Three times the difference between the weights and those of order 4.
    error: &[
        3.0 * (35.0 / 384.0 - 5179.0 / 57600.0),
        0.0,
        3.0 * (500.0 / 1113.0 - 7571.0 / 16695.0),
        3.0 * (125.0 / 192.0 - 393.0 / 640.0),
        3.0 * (-2187.0 / 6784.0 + 92097.0 / 339200.0),
        3.0 * (11.0 / 84.0 - 187.0 / 2100.0),
        -3.0 / 40.0,
    ],
    error_order: 5.0,
    first_same_as_last: true,
    dense: Some(dormand_prince_inside),
    real_stability: 3.31,
};

/// Dense output of order 4 of the method of Dormand and Prince.
///
/// It is a cubic Hermite interpolant with a correction of degree four, written as weights of the slopes.
/// E. Hairer, S. P. Norsett, G. Wanner, Solving ODEs I, II.6.
fn dormand_prince_inside(share: f64) -> [f64; 7] {
    const CORRECTION: [f64; 7] = [
        -12715105075.0 / 11282082432.0,
        0.0,
        87487479700.0 / 32700410799.0,
        -10690763975.0 / 1880347072.0,
        701980252875.0 / 199316789632.0,
        -1453857185.0 / 822651844.0,
        69997945.0 / 29380423.0,
    ];
    let rest = 1.0 - share;
    let mut weights: [f64; 7] = std::array::from_fn(|s| {
        share * share * (1.0 + 2.0 * rest) * DORMAND_PRINCE.b[s] + share * share * rest * rest * CORRECTION[s]
    });
    weights[0] += share * rest * rest;
    weights[6] -= share * share * rest;
    weights
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sum over the stages of b_s * f(s).
    fn weigh(b: &[f64], f: impl Fn(usize) -> f64) -> f64 {
        b.iter().enumerate().map(|(s, b)| b * f(s)).sum()
    }

    /// Left and right sides of the conditions up to order four. The first 1, 2, 4 and 8 of them are those up
    /// to order 1, 2, 3 and 4.
    fn conditions(table: &Tableau, b: &[f64]) -> Vec<(f64, f64)> {
        let row = |s: usize, f: &dyn Fn(usize) -> f64| weigh(table.a[s], f);
        let c = |s: usize| table.c[s];
        let ac = |s: usize| row(s, &c);
        vec![
            (weigh(b, |_| 1.0), 1.0),
            (weigh(b, c), 1.0 / 2.0),
            (weigh(b, |s| c(s).powi(2)), 1.0 / 3.0),
            (weigh(b, ac), 1.0 / 6.0),
            (weigh(b, |s| c(s).powi(3)), 1.0 / 4.0),
            (weigh(b, |s| c(s) * ac(s)), 1.0 / 8.0),
            (weigh(b, |s| row(s, &|k| c(k).powi(2))), 1.0 / 12.0),
            (weigh(b, |s| row(s, &ac)), 1.0 / 24.0),
        ]
    }

    /// The nine further conditions of order five.
    fn conditions_of_order_five(table: &Tableau) -> Vec<(f64, f64)> {
        let b = table.b;
        let row = |s: usize, f: &dyn Fn(usize) -> f64| weigh(table.a[s], f);
        let c = |s: usize| table.c[s];
        let ac = |s: usize| row(s, &c);
        let acc = |s: usize| row(s, &|k| c(k).powi(2));
        let aac = |s: usize| row(s, &ac);
        vec![
            (weigh(b, |s| c(s).powi(4)), 1.0 / 5.0),
            (weigh(b, |s| c(s).powi(2) * ac(s)), 1.0 / 10.0),
            (weigh(b, |s| ac(s).powi(2)), 1.0 / 20.0),
            (weigh(b, |s| c(s) * acc(s)), 1.0 / 15.0),
            (weigh(b, |s| row(s, &|k| c(k).powi(3))), 1.0 / 20.0),
            (weigh(b, |s| c(s) * aac(s)), 1.0 / 30.0),
            (weigh(b, |s| row(s, &|k| c(k) * ac(k))), 1.0 / 40.0),
            (weigh(b, |s| row(s, &acc)), 1.0 / 60.0),
            (weigh(b, |s| row(s, &aac)), 1.0 / 120.0),
        ]
    }

    fn assert_met(conditions: Vec<(f64, f64)>) {
        for (k, (found, exact)) in conditions.into_iter().enumerate() {
            assert!((found - exact).abs() < 1e-14, "condition {k}: {found} is not {exact}");
        }
    }

    #[test]
    fn merson_meets_the_eight_conditions_of_order_four() {
        assert_met(conditions(&MERSON, MERSON.b));
    }

    #[test]
    fn dormand_prince_meets_the_seventeen_conditions_of_order_five() {
        assert_met(conditions(&DORMAND_PRINCE, DORMAND_PRINCE.b));
        assert_met(conditions_of_order_five(&DORMAND_PRINCE));
    }

    #[test]
    fn the_embedded_method_of_dormand_and_prince_has_order_four() {
        let weights: Vec<f64> =
            DORMAND_PRINCE.b.iter().zip(DORMAND_PRINCE.error).map(|(b, e)| b - e / 3.0).collect();
        assert_met(conditions(&DORMAND_PRINCE, &weights));
    }

    #[test]
    fn rows_add_up_to_the_stage_times_and_the_error_sees_no_constant_slope() {
        for table in [&MERSON, &DORMAND_PRINCE] {
            for s in 0..table.stages() {
                assert!((weigh(table.a[s], |_| 1.0) - table.c[s]).abs() < 1e-14, "row {s}");
            }
            assert!(weigh(table.error, |_| 1.0).abs() < 1e-15);
            if table.first_same_as_last {
                assert_eq!(table.a[table.stages() - 1], &table.b[..table.stages() - 1]);
            }
        }
    }

    #[test]
    fn the_inside_of_a_step_of_dormand_and_prince_has_order_four() {
        // The conditions of order q at a share theta of the step are those at its end, times theta^q.
        for share in [0.0f64, 0.1, 0.37, 0.5, 0.9, 1.0] {
            let weights = dormand_prince_inside(share);
            let orders = [1, 2, 3, 3, 4, 4, 4, 4];
            for ((found, exact), order) in conditions(&DORMAND_PRINCE, &weights).into_iter().zip(orders) {
                assert!((found - exact * share.powi(order)).abs() < 1e-14, "share {share}, order {order}");
            }
        }
        assert_eq!(dormand_prince_inside(1.0), DORMAND_PRINCE.b);
    }

    /// Growth factor of a step for y' = z y.
    fn growth(table: &Tableau, z: f64) -> f64 {
        let mut slopes: Vec<f64> = Vec::new();
        for s in 0..table.stages() {
            let stage = 1.0 + weigh(table.a[s], |k| slopes[k]);
            slopes.push(z * stage);
        }
        1.0 + weigh(table.b, |s| slopes[s])
    }

    #[test]
    fn the_real_stability_bound_is_the_edge_of_the_stable_interval() {
        for table in [&MERSON, &DORMAND_PRINCE] {
            let edge = table.real_stability;
            assert!(growth(table, -edge + 0.02).abs() <= 1.0, "{}", table.name);
            assert!(growth(table, -edge - 0.03).abs() > 1.0, "{}", table.name);
        }
    }
}
