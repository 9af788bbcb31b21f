//! The command line of `demhybrid analyze`.

use std::path::PathBuf;

use crate::record::Which;

/// Which bed to measure, and where to put what was found.
#[derive(Debug, Clone, PartialEq, clap::Args)]
#[command(after_help = AFTER_HELP)]
pub struct AnalyzeArgs {
    /// Output file of a run
    pub run: PathBuf,

    /// Folder for tables (CSV), figures (SVG), summary.json and report.html [default: RUN's name with -analysis]
    #[arg(short, long, value_name = "FOLDER")]
    pub output: Option<PathBuf>,

    /// Frame: last (the last complete one), a number from 0 on, or all; what is no row a frame is of the last of them
    #[arg(long, default_value = "last", value_name = "last|K|all")]
    pub frame: Which,

    /// Measure volumes in this box, m, in place of the bed: two corners
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", allow_hyphen_values = true, value_parser = box_corners)]
    #[arg(conflicts_with_all = ["cylinder", "whole"])]
    pub r#box: Option<[f64; 6]>,

    /// Measure volumes in this upright cylinder, m: its axis, radius and ends
    #[arg(long, value_name = "X,Y,RADIUS,Z0,Z1", allow_hyphen_values = true, value_parser = upright_cylinder)]
    #[arg(conflicts_with = "whole")]
    pub cylinder: Option<[f64; 5]>,

    /// Measure volumes in the whole bed: the container up to the highest point of any sphere
    #[arg(long)]
    pub whole: bool,

    /// Write to a folder that is not empty
    #[arg(long)]
    pub force: bool,
}

/// `N` finite numbers between commas.
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

const AFTER_HELP: &str = "\
Examples:
  demhybrid analyze settle.vtkhdf
  demhybrid analyze settle.vtkhdf --frame all -o settle-over-time
  demhybrid analyze settle.vtkhdf --cylinder 0.5,0.5,0.4,0.1,0.9 --force

Volumes are those of the union of all spheres inside the region, exact to 1e-9 of it; what spheres cover several times
is reported apart, and the paper's own count in [0, 1]^3, which counts it as often, beside it. Without --box, --cylinder
or --whole the region is the base of container.box up to the shorter side of the base, or, where less than a tenth of the
centres lie above that, up to the height below which three quarters of them lie.
Spheres touch where their gap is not positive. Rattlers have too few contacts to be held: fewer than 4, less 1 with
gravity, less 1 with friction, walls counted and other rattlers not.";

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
    }
}
