//! Options for the region of a bed in which volumes are measured.

use crate::beds::measures::request::RegionRequest;
use crate::math::vector::Vec3;

#[allow(missing_docs, reason = "its doc would take the place of the help of the command")]
#[derive(Debug, Clone, Default, PartialEq, clap::Args)]
pub struct RegionArgs {
    /// Measure volumes in what walls and this box have in common: two corners, m
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", allow_hyphen_values = true, value_parser = box_corners)]
    #[arg(conflicts_with_all = ["cylinder", "layer", "whole"])]
    pub r#box: Option<[f64; 6]>,

    /// Measure volumes in what walls and this cylinder along z have in common: its axis, radius and ends, m
    #[arg(long, value_name = "X,Y,RADIUS,Z0,Z1", allow_hyphen_values = true, value_parser = upright_cylinder)]
    #[arg(conflicts_with_all = ["layer", "whole"])]
    pub cylinder: Option<[f64; 5]>,

    /// Measure volumes between two heights above the lowest point inside all walls, against gravity, m
    #[arg(long, value_name = "FROM,TO", allow_hyphen_values = true, value_parser = two_heights)]
    #[arg(conflicts_with = "whole")]
    pub layer: Option<[f64; 2]>,

    /// Measure volumes in the whole bed: all that walls enclose, up to the highest point of any sphere
    #[arg(long)]
    pub whole: bool,
}

impl RegionArgs {
    /// The region that the options ask for.
    pub fn region(&self) -> RegionRequest {
        if let Some([a, b, c, d, e, f]) = self.r#box {
            return RegionRequest::Box { low: Vec3::new(a, b, c), high: Vec3::new(d, e, f) };
        }
        if let Some([x, y, radius, from, to]) = self.cylinder {
            return RegionRequest::Cylinder { axis: [x, y], radius, ends: [from, to] };
        }
        if let Some(ends) = self.layer {
            return RegionRequest::Layer(ends);
        }
        if self.whole { RegionRequest::Whole } else { RegionRequest::Bed }
    }
}

/// Reads `N` finite numbers, separated by commas.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let parsed: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    parsed
        .filter(|numbers| numbers.iter().all(|number| number.is_finite()))
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| format!("it must be {N} finite numbers between commas, in m"))
}

fn box_corners(text: &str) -> Result<[f64; 6], String> {
    let corners: [f64; 6] = numbers(text)?;
    match (0..3).all(|k| corners[k] < corners[k + 3]) {
        true => Ok(corners),
        false => Err("the second corner must be beyond the first on every axis".into()),
    }
}

fn upright_cylinder(text: &str) -> Result<[f64; 5], String> {
    let cylinder: [f64; 5] = numbers(text)?;
    match cylinder[2] > 0.0 && cylinder[3] < cylinder[4] {
        true => Ok(cylinder),
        false => Err("the radius must be greater than 0, and Z1 greater than Z0".into()),
    }
}

fn two_heights(text: &str) -> Result<[f64; 2], String> {
    let heights: [f64; 2] = numbers(text)?;
    match heights[0] < heights[1] {
        true => Ok(heights),
        false => Err("TO must be greater than FROM".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_are_read_and_mistakes_explained() {
        assert_eq!(box_corners("-1,0,0, 1,2,3.5"), Ok([-1.0, 0.0, 0.0, 1.0, 2.0, 3.5]));
        assert_eq!(upright_cylinder("0,0,1,-1,1"), Ok([0.0, 0.0, 1.0, -1.0, 1.0]));
        for text in ["", "1,2,3", "1,2,3,4,5,x", "0,0,0,1,1,inf", "0,0,0,1,1,1,1"] {
            assert!(box_corners(text).unwrap_err().contains("6 finite numbers"), "{text}");
        }
        assert!(box_corners("0,0,0,1,1,0").unwrap_err().contains("beyond"));
        assert!(upright_cylinder("0,0,0,0,1").unwrap_err().contains("greater than 0"));
        assert!(upright_cylinder("0,0,1,1,1").unwrap_err().contains("Z1 greater"));
        assert_eq!(two_heights("-0.5,1"), Ok([-0.5, 1.0]));
        assert!(two_heights("1,1").unwrap_err().contains("greater than FROM"));
    }
}
