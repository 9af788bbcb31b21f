//! Explicit Runge-Kutta methods as tables.

/// An explicit Runge-Kutta method with an error estimate.
#[derive(Debug)]
pub struct Tableau {
    /// Name in the scene file.
    pub name: &'static str,
    /// Order of the solution.
    pub order: u32,
    /// Stage times as shares of the step.
    pub c: &'static [f64],
    /// Row s: weights of the slopes 0..s in stage s.
    pub a: &'static [&'static [f64]],
    /// Weights of the slopes in the solution.
    pub b: &'static [f64],
    /// Weights of the slopes in the error rate, which is compared with the tolerance.
    pub error: &'static [f64],
    /// The step is scaled by (tolerance/error) to this power.
    pub exponent: f64,
}

impl Tableau {
    /// Number of stages.
    pub fn stages(&self) -> usize {
        self.b.len()
    }
}

/// Merson's method of order 4 with five stages. R. H. Merson (1957); J. Christiansen, Numer. Math. 14 (1970) 317.
/// The error rate and the rule for the step are those of the paper's solver (P. Strachota, M. Beneš, ALGORITMY 2016,
/// 23-32): the rate is 3/h times Merson's estimate of the local error.
pub const MERSON: Tableau = Tableau {
    name: "merson",
    order: 4,
    c: &[0.0, 1.0 / 3.0, 1.0 / 3.0, 0.5, 1.0],
    a: &[&[], &[1.0 / 3.0], &[1.0 / 6.0, 1.0 / 6.0], &[0.125, 0.0, 0.375], &[0.5, 0.0, -1.5, 2.0]],
    b: &[1.0 / 6.0, 0.0, 0.0, 2.0 / 3.0, 1.0 / 6.0],
    error: &[0.2, 0.0, -0.9, 0.8, -0.1],
    exponent: 0.2,
};

#[cfg(test)]
mod tests {
    use super::*;

    /// Sum over the stages of b_s * f(s).
    fn weigh(b: &[f64], f: impl Fn(usize) -> f64) -> f64 {
        b.iter().enumerate().map(|(s, b)| b * f(s)).sum()
    }

    #[test]
    fn merson_meets_the_eight_conditions_of_order_four() {
        let m = &MERSON;
        let row = |s: usize, f: &dyn Fn(usize) -> f64| weigh(m.a[s], f);
        let c = |s: usize| m.c[s];
        let ac = |s: usize| row(s, &c);
        let conditions = [
            (weigh(m.b, |_| 1.0), 1.0),
            (weigh(m.b, c), 1.0 / 2.0),
            (weigh(m.b, |s| c(s).powi(2)), 1.0 / 3.0),
            (weigh(m.b, ac), 1.0 / 6.0),
            (weigh(m.b, |s| c(s).powi(3)), 1.0 / 4.0),
            (weigh(m.b, |s| c(s) * ac(s)), 1.0 / 8.0),
            (weigh(m.b, |s| row(s, &|k| c(k).powi(2))), 1.0 / 12.0),
            (weigh(m.b, |s| row(s, &ac)), 1.0 / 24.0),
        ];
        for (k, (found, exact)) in conditions.into_iter().enumerate() {
            assert!((found - exact).abs() < 1e-15, "condition {k}: {found} is not {exact}");
        }
    }

    #[test]
    fn rows_add_up_to_the_stage_times_and_the_error_sees_no_constant_slope() {
        for s in 0..MERSON.stages() {
            assert!((weigh(MERSON.a[s], |_| 1.0) - MERSON.c[s]).abs() < 1e-15);
        }
        assert!(weigh(MERSON.error, |_| 1.0).abs() < 1e-15);
        assert!(weigh(MERSON.error, |s| MERSON.c[s]).abs() < 1e-15);
    }
}
