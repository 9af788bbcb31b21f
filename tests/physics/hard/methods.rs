//! Every hard case with every method, on one rank.

use super::judge::{all_are_right, run};
use super::scene::{Case, METHODS, cases};
use demhybrid::domain::Solo;

#[test]
fn hard_cases_end_as_they_should_with_the_default_method() {
    all_are_right(&cases(), "auto", &Solo);
}

#[test]
fn hard_cases_end_as_they_should_with_merson() {
    all_are_right(&cases(), "merson", &Solo);
}

#[test]
fn hard_cases_end_as_they_should_with_dormand_prince() {
    all_are_right(&cases(), "dormand-prince", &Solo);
}

#[test]
fn hard_cases_end_as_they_should_with_chebyshev() {
    all_are_right(&cases(), "chebyshev", &Solo);
}

#[test]
fn hard_cases_end_as_they_should_with_velocity_verlet() {
    all_are_right(&cases(), "velocity-verlet", &Solo);
}

#[test]
fn every_hard_case_is_for_the_default_method_and_at_least_two_others() {
    for case in cases() {
        let others = METHODS.iter().filter(|method| case.is_for(method)).count();
        assert!(case.is_for("auto") && others >= 3, "{}", case.name);
    }
}

#[test]
fn chebyshev_alone_creates_energy_where_nothing_dissipates_and_the_program_says_so() {
    // Why `auto` never asks it there: undamped waves grow in it.
    let tale = run(&Case::read("e-1-smooth"), "chebyshev", &Solo);
    assert!(
        tale.warnings.iter().any(|warning| warning.contains("energy was created")),
        "{:?}",
        tale.warnings
    );
}
