//! A voxel image of pore and solid, in a form that pore-scale solvers read.
//!
//! The image is a box along the axes around the region. A voxel outside the region has a value of its own, so
//! that the porosity of the image is that of the region.

use std::io::{self, Write};
use std::path::Path;

use super::{FrameData, Phase};
use crate::beds::measures::region::Region;
use crate::error::Error;
use crate::math::vector::Vec3;

/// Largest number of voxels in an image.
const MOST_VOXELS: f64 = 1e10;

/// Value of a voxel outside the region, which is neither pore nor solid.
const OUTSIDE: u8 = 2;

/// How many voxels an image has of each kind.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Voxels that are 1.
    ones: u64,
    /// Voxels in the region.
    inside: u64,
}

/// The region and the grid of the voxels, and the phase that is 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    region: Region,
    /// Numbers of voxels along x, y and z.
    shape: [usize; 3],
    /// Side of a voxel, m.
    spacing: f64,
    /// Lower corner of the first voxel, m.
    origin: Vec3,
    ones: Phase,
}

impl Image {
    /// The image of all that the walls enclose, with `resolution` voxels per radius; per mean radius where
    /// radii differ.
    ///
    /// The number of voxels along each axis is rounded to a whole number.
    pub fn of(frame: &FrameData, resolution: f64, ones: Phase) -> Result<Self, Error> {
        let region = frame.region();
        if region.is_empty() {
            return Err(Error::Input("--to raw: no sphere is inside the walls, so there is no image".into()));
        }
        let (low, high) = region.bounds();
        let spacing = frame.typical_radius() / resolution;
        let along = [0, 1, 2].map(|k| ((high[k] - low[k]) / spacing).round().max(1.0));
        let voxels: f64 = along.iter().product();
        // The condition also refuses NaN.
        if !(voxels <= MOST_VOXELS && spacing > 0.0) {
            return Err(Error::Input(format!(
                "--resolution {resolution}: an image of {:e} x {:e} x {:e} voxels, more than the \
                 {MOST_VOXELS:e} that it may have: choose fewer voxels per radius",
                along[0], along[1], along[2]
            )));
        }
        Ok(Image { region, shape: along.map(|n| n as usize), spacing, origin: low, ones })
    }

    fn centre(&self, axis: usize, k: usize) -> f64 {
        self.origin[axis] + (k as f64 + 0.5) * self.spacing
    }

    /// Voxels along `axis` whose centres are within `distance` (m) of `x` (m), and perhaps one more at each
    /// end.
    fn around(&self, axis: usize, x: f64, distance: f64) -> std::ops::Range<usize> {
        // Casts saturate, so a position below the first voxel gives 0.
        let voxel = |x: f64| ((x - self.origin[axis]) / self.spacing).floor() as usize;
        voxel(x - distance).min(self.shape[axis])..voxel(x + distance).saturating_add(1).min(self.shape[axis])
    }

    /// Writes the voxels layer by layer, with x fastest, and counts them.
    pub fn write(&self, frame: &FrameData, out: &mut dyn Write) -> io::Result<Counts> {
        let [nx, ny, nz] = self.shape;
        let sizes = frame.sizes();
        let halves = self.region.halves();
        // A centre on a plane may fall beyond it by rounding.
        let tiny = 1e-9 * self.spacing;
        let mut spheres_from = vec![Vec::new(); nz];
        let mut last_of = Vec::with_capacity(frame.state.x.len());
        for (id, x) in frame.state.x.iter().enumerate() {
            let layers = self.around(2, x[2], sizes.of(id).r);
            last_of.push(layers.end);
            if !layers.is_empty() {
                spheres_from[layers.start].push(id);
            }
        }
        let solid = u8::from(self.ones == Phase::Solid);
        let mut layer = vec![0; nx * ny];
        let mut active: Vec<usize> = Vec::new();
        let mut counts = Counts::default();
        for (k, starting) in spheres_from.iter().enumerate() {
            active.retain(|&id| last_of[id] > k);
            active.extend(starting);
            layer.fill(1 - solid);
            let z = self.centre(2, k);
            for (x, r) in active.iter().map(|&id| (&frame.state.x[id], sizes.of(id).r)) {
                for j in self.around(1, x[1], r) {
                    let half2 = r * r - (z - x[2]).powi(2) - (self.centre(1, j) - x[1]).powi(2);
                    if half2 >= 0.0 {
                        for i in self.around(0, x[0], half2.sqrt()) {
                            if (self.centre(0, i) - x[0]).powi(2) <= half2 {
                                layer[j * nx + i] = solid;
                            }
                        }
                    }
                }
            }
            for j in 0..ny {
                // The voxels of a row that are in the region are next to each other.
                let row = &mut layer[j * nx..(j + 1) * nx];
                let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
                let start = Vec3::new(0.0, self.centre(1, j), z);
                for half in &halves {
                    let room = tiny - half.beyond(&start);
                    if half.n.x > 1e-14 {
                        to = to.min(room / half.n.x);
                    } else if half.n.x < -1e-14 {
                        from = from.max(room / half.n.x);
                    } else if room < 0.0 {
                        to = f64::NEG_INFINITY;
                    }
                }
                for (i, value) in row.iter_mut().enumerate() {
                    let x = self.centre(0, i);
                    if x < from || x > to {
                        *value = OUTSIDE;
                    }
                }
                counts.ones += row.iter().filter(|&&value| value == 1).count() as u64;
                counts.inside += row.iter().filter(|&&value| value != OUTSIDE).count() as u64;
            }
            out.write_all(&layer)?;
        }
        Ok(counts)
    }

    /// The header as JSON.
    pub fn header(&self, frame: &FrameData, image: &Path, counts: &Counts) -> String {
        let voxels = self.shape.iter().product::<usize>() as u64;
        let share = counts.ones as f64 / counts.inside as f64;
        let mut header = serde_json::json!({
            "file": image.file_name().unwrap_or_default().to_string_lossy(),
            "shape": self.shape,
            "spacing": ([self.spacing; 3]),
            "origin": [self.origin.x, self.origin.y, self.origin.z],
            "unit": "m",
            "order": "x fastest, then y, then z: voxel (i, j, k) is byte i + shape[0]*(j + shape[1]*k), \
                      centred at origin + (i + 1/2, j + 1/2, k + 1/2)*spacing",
            "type": "uint8",
            "one": self.ones.name(),
            "zero": if self.ones == Phase::Solid { Phase::Pore } else { Phase::Solid }.name(),
            "two": "outside the region, which walls and the bed height enclose: neither pore nor solid",
            "voxels_outside": voxels - counts.inside,
            "share_of_ones": share,
            "porosity": if self.ones == Phase::Pore { share } else { 1.0 - share },
            "region_volume": self.region.volume(),
            "radius": frame.typical_radius(),
            "frame": frame.state.frame,
            "time": frame.state.time,
        });
        if frame.is_sized() {
            let radii = || frame.state.sizes.iter().map(|size| size.r);
            header["radius_is"] = "the mean".into();
            header["smallest_radius"] = radii().fold(f64::INFINITY, f64::min).into();
            header["largest_radius"] = radii().fold(0.0, f64::max).into();
        }
        format!("{header:#}\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::beds::export::testing::sized;
    use std::f64::consts::PI;

    #[test]
    fn voxels_are_solid_within_the_radius_of_each_sphere_up_to_the_highest_point_of_any() {
        let (scene, state, _) = sized();
        let frame = FrameData { scene: &scene, state: &state, species: None };
        let image = Image::of(&frame, 14.0, Phase::Solid).unwrap();
        let mut bytes = Vec::new();
        let counts = image.write(&frame, &mut bytes).unwrap();
        let header: serde_json::Value =
            serde_json::from_str(&image.header(&frame, Path::new("a.raw"), &counts)).unwrap();
        // The largest sphere ends at 0.4 m. The mean radius is 0.17/3 m, so that a voxel has 0.17/42 m.
        assert!((header["region_volume"].as_f64().unwrap() - 0.4).abs() < 1e-12, "{header}");
        assert_eq!(header["shape"], serde_json::json!([247, 247, 99]));
        assert_eq!([&header["smallest_radius"], &header["largest_radius"]], [0.02, 0.1]);
        let cubes: f64 = [0.1f64, 0.05, 0.02].iter().map(|r| r.powi(3)).sum();
        let volume = counts.ones as f64 * image.spacing.powi(3);
        assert!((volume / (4.0 / 3.0 * PI * cubes) - 1.0).abs() < 0.01, "{volume}");
    }
}
