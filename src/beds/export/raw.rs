//! A voxel image of pore and solid, in a form that pore-scale solvers read.

use std::io::{self, Write};
use std::path::Path;

use super::{FrameData, Phase};
use crate::beds::measures::region;
use crate::error::Error;
use crate::math::vector::Vec3;
use crate::model::wall::Wall;

/// Largest number of voxels in an image.
const MOST_VOXELS: f64 = 1e10;

/// The grid of the voxels, and the phase that is 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Numbers of voxels along x, y and z.
    shape: [usize; 3],
    /// Side of a voxel, m.
    spacing: f64,
    /// Lower corner of the first voxel, m.
    origin: Vec3,
    ones: Phase,
}

impl Image {
    /// The image of the container's box, with `resolution` voxels per radius.
    ///
    /// The number of voxels along each axis is rounded to a whole number.
    pub fn of(frame: &FrameData, resolution: f64, ones: Phase) -> Result<Self, Error> {
        let (low, high) = region::container_box(frame.scene, &frame.centres());
        let spacing = frame.radius() / resolution;
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
        Ok(Image { shape: along.map(|n| n as usize), spacing, origin: low, ones })
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

    /// Writes the voxels layer by layer, with x fastest; returns the number of voxels that are 1.
    pub fn write(&self, frame: &FrameData, out: &mut dyn Write) -> io::Result<u64> {
        let [nx, ny, nz] = self.shape;
        let r = frame.radius();
        let planes: Vec<Wall> = frame
            .scene
            .container
            .wall
            .iter()
            .map(|wall| Wall::new(wall.point.into(), wall.normal.into()))
            .collect();
        let mut spheres_from = vec![Vec::new(); nz];
        let mut last_of = Vec::with_capacity(frame.state.x.len());
        for (id, x) in frame.state.x.iter().enumerate() {
            let layers = self.around(2, x[2], r);
            last_of.push(layers.end);
            if !layers.is_empty() {
                spheres_from[layers.start].push(id);
            }
        }
        let solid = u8::from(self.ones == Phase::Solid);
        let mut layer = vec![0; nx * ny];
        let mut active: Vec<usize> = Vec::new();
        let mut ones = 0;
        for (k, starting) in spheres_from.iter().enumerate() {
            active.retain(|&id| last_of[id] > k);
            active.extend(starting);
            layer.fill(1 - solid);
            let z = self.centre(2, k);
            for x in active.iter().map(|&id| &frame.state.x[id]) {
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
            for plane in &planes {
                for (voxel, value) in layer.iter_mut().enumerate() {
                    let at = Vec3::new(self.centre(0, voxel % nx), self.centre(1, voxel / nx), z);
                    if plane.depth(&at) < 0.0 {
                        *value = solid;
                    }
                }
            }
            ones += layer.iter().map(|&value| u64::from(value)).sum::<u64>();
            out.write_all(&layer)?;
        }
        Ok(ones)
    }

    /// The header as JSON.
    pub fn header(&self, frame: &FrameData, image: &Path, ones: u64) -> String {
        let voxels = self.shape.iter().product::<usize>() as f64;
        let header = serde_json::json!({
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
            "share_of_ones": ones as f64 / voxels,
            "radius": frame.radius(),
            "frame": frame.state.frame,
            "time": frame.state.time,
        });
        format!("{header:#}\n")
    }
}
